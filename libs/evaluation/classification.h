#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/track_files.h"
#include "dataset/trajectory_files.h"

namespace omnifleet::evaluation {

/// Counts of one class against all else.
struct ClassCounts {
  int right = 0;      ///< it is one and was called one
  int missed = 0;     ///< it is one and was called something else (unknown included)
  int wrong = 0;      ///< it is none and was called one
  double f1() const;  ///< 2·right / (2·right + missed + wrong); NaN where there was nothing to tell
  ClassCounts& operator+=(const ClassCounts& other);
};

struct KindMetrics {
  ClassCounts robot, obstacle;
  int phantoms = 0;  ///< tracks near nothing true; each counts as wrong in the class it was called
  KindMetrics& operator+=(const KindMetrics& other);
};

/// Robots told from obstacles, per object and frame: each visible track of `observer` against the nearest
/// true thing (another robot's centre, an obstacle's centroid or inside of its footprint) within `gate_m`.
/// Rows at times without truth of the observer are left out.
KindMetrics compareKinds(const std::string& observer, const std::vector<dataset::TrackRow>& tracks,
                         const std::map<std::string, std::vector<dataset::StampedPose>>& truth,
                         const std::vector<dataset::MapObject>& scene, double gate_m = 0.3);

}  // namespace omnifleet::evaluation
