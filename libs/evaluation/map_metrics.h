#pragma once

#include <vector>

#include "dataset/map_files.h"
#include "options/options.h"

namespace omnifleet::evaluation {

struct MapOptions {
  double gate_m = 0.15;  ///< maximum distance between the centroids of a match, metres
  double min_iou = 0.3;  ///< minimum overlap (IoU) of the footprints of a match

  static MapOptions read(const options::Section& section);
};

struct ObstacleMatch {
  int truth = 0, estimate = 0;    ///< indices into the input lists
  double dx_m = 0.0, dy_m = 0.0;  ///< estimate − truth of the centroids
  double iou = 0.0;
};

/// Map metrics (docs/methods/evaluation.md): Hungarian matching by centroid distance within the gate, among
/// pairs that overlap enough, without alignment. Means over the matches; NaN without matches
/// (distances_error_m: with fewer than two).
struct MapMetrics {
  int truths = 0, estimates = 0;
  std::vector<ObstacleMatch> matches;
  std::vector<int> missed, falsely_found;  ///< indices of truths / estimates without a match
  /// Of the missed: a fifth of the outline (less than one side of a box) or more lies within 5 cm of
  /// structure.
  std::vector<int> drawn_as_structure;
  double recall = 0.0, precision = 0.0;     ///< 1 if there is no truth / no estimate
  double x_error_m = 0.0, y_error_m = 0.0;  ///< mean |Δx|, |Δy|
  double iou = 0.0;
  /// Choi et al. 2014, §V, their comparison without a common frame: mean over all pairs of matched obstacles
  /// of |estimated − true distance|.
  double distances_error_m = 0.0;
};

/// Compares objects of kind "obstacle". Other objects (robots) are ignored in both lists; lines of kind
/// "structure" in `estimate` only fill `drawn_as_structure`.
MapMetrics compareMaps(const std::vector<dataset::MapObject>& truth,
                       const std::vector<dataset::MapObject>& estimate, const MapOptions& options);

}  // namespace omnifleet::evaluation
