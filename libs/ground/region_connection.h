#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "ground/labelling.h"
#include "options/options.h"

namespace omnifleet::ground {

struct ConnectionOptions {
  std::string method =
      "pixels";    ///< "rectangles": Algorithm 1 as printed; "pixels": the regions themselves must be close
  int gap_px = 0;  ///< pixels between rectangles or regions that still count as "closely located"
  static ConnectionOptions read(const options::Section& section);
};

/// Choi et al. 2014, Algorithm 1. Regions whose rectangles overlap (lines 3–7), contain one another (8–12) or
/// are closely located are merged, over all pairs until nothing changes. Then labels are overridden (17–19)
/// and sorted by position (20–22): 1…N from top to bottom, left to right of the rectangles. Line 7 is read as
/// the height.
/// Departure ("pixels"): rectangles of neighbours overlap long before the objects touch. The gap is therefore
/// measured between the regions' pixels.
class RegionConnection {
 public:
  explicit RegionConnection(const ConnectionOptions& options) : options_(options) {}

  const std::vector<Blob>& connect(const std::vector<Blob>& blobs);

 private:
  bool close(const Blob& a, const Blob& b) const;

  ConnectionOptions options_;
  std::vector<Blob> blobs_;
  BlobPool pool_;
};

/// Smallest number of background pixels between two regions along rows or columns (Chebyshev distance − 1; 0:
/// they touch), or more than `limit` when they are farther apart.
int pixelGap(const Blob& a, const Blob& b, int limit);

}  // namespace omnifleet::ground
