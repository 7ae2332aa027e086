#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/track_files.h"
#include "dataset/trajectory_files.h"

namespace omnifleet::evaluation {

/// Counts of one class against all others.
struct ClassCounts {
  int right = 0;      ///< true positives
  int missed = 0;     ///< false negatives, including tracks of unknown kind
  int wrong = 0;      ///< false positives
  double f1() const;  ///< 2·right / (2·right + missed + wrong); NaN without samples
  ClassCounts& operator+=(const ClassCounts& other);
};

struct KindMetrics {
  ClassCounts robot, obstacle;
  int phantoms =
      0;  ///< tracks without a true object within the gate; each counts as wrong in the class it was assigned
  KindMetrics& operator+=(const KindMetrics& other);
};

/// Scores robots against obstacles, per object and frame. Each visible track of `observer` is compared with
/// the nearest true object within `gate_m`: the centre of another robot, or the footprint or else the
/// centroid of an obstacle. Rows at times without ground truth of the observer are ignored.
KindMetrics compareKinds(const std::string& observer, const std::vector<dataset::TrackRow>& tracks,
                         const std::map<std::string, std::vector<dataset::StampedPose>>& truth,
                         const std::vector<dataset::MapObject>& scene, double gate_m = 0.3);

}  // namespace omnifleet::evaluation
