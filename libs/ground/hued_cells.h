#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Regions of cells whose hue is not quite the floor's. Alone such a cell tells nothing; a ring of them does
/// (LowWalls::findFaint): noise tears walls whose hue is near the floor's to pieces, but not these.
class HuedCells {
 public:
  explicit HuedCells(cv::Size image);

  /// Per cell of the frame.
  struct Frame {
    const cv::Mat1b& off;      ///< with one of margin: 1 where it is not plainly floor
    const cv::Mat1f& across2;  ///< likewise, there: CellHues::across2
    const cv::Mat3f& colours;  ///< means
    const cv::Mat3f& floor;    ///< what the floor's would be
    float tolerance_across;    ///< share of the brightness by which the floor's hue may be off
    float hue_noise;           ///< σ of a mean, grey levels
  };
  /// @param area of the regions, whole cells @return valid until the next call
  const std::vector<Blob>& find(const Frame& frame, const BitArea& area);

 private:
  void mark(const Frame& frame);

  cv::Mat1b cells_;  ///< 1 where it has a hue
  BitMask pixels_;
  Labeller labeller_;
};

}  // namespace omnifleet::ground
