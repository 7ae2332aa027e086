#pragma once

#include <vector>

#include "dataset/map_files.h"
#include "options/options.h"

namespace omnifleet::evaluation {

struct MapOptions {
  double gate_m = 0.15;  ///< largest distance between the centroids of a match, metres
  double min_iou = 0.3;  ///< least overlap of the footprints of a match

  static MapOptions read(const options::Section& section);
};

struct ObstacleMatch {
  int truth = 0, estimate = 0;    ///< indices into the lists given
  double dx_m = 0.0, dy_m = 0.0;  ///< estimate − truth, centroids
  double iou = 0.0;
};

/// docs/methods.md, "Metrics": Hungarian matching by centroid within the gate among pairs that overlap
/// enough, no alignment. Means over the matches; NaN where there is none (distances error: fewer than two).
struct MapMetrics {
  int truths = 0, estimates = 0;
  std::vector<ObstacleMatch> matches;
  std::vector<int> missed, falsely_found;   ///< indices of truths / estimates without a partner
  double recall = 0.0, precision = 0.0;     ///< 1 where there was nothing to find / nothing was said
  double x_error_m = 0.0, y_error_m = 0.0;  ///< mean |Δx|, |Δy|
  double iou = 0.0;
  /// Choi et al. 2014, §V (their way to compare without a common frame): mean over all pairs of matched
  /// obstacles of the |difference| between estimated and true distance.
  double distances_error_m = 0.0;
};

/// Objects of kind "obstacle" are compared, others (robots) are ignored on both sides.
MapMetrics compareMaps(const std::vector<dataset::MapObject>& truth,
                       const std::vector<dataset::MapObject>& estimate, const MapOptions& options);

}  // namespace omnifleet::evaluation
