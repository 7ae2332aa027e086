#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <string>

#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::dataset {

/// How the poses of one robot relate to the common map.
struct RobotMerge {
  AlignmentStatus status = AlignmentStatus::kUndecided;
  std::string frame;  ///< of its poses: "map" or the name of the robot; empty (null): it has no pose
  std::string reason;
  std::optional<double> score;           ///< 0 … 1; none: nobody reported one
  std::optional<Pose2> map_from_frame;   ///< matched: how the robot's own frame lies in `map`
  std::optional<Eigen::Vector2d> sigma;  ///< matched: σ of the relation, m (larger axis) and rad
  std::optional<double> time_s;          ///< of the evidence; none: nobody reported it

  bool isInMap() const { return frame == kMap; }
  bool isInItsOwnFrame() const { return !frame.empty() && !isInMap(); }
  static constexpr const char* kMap = "map";
};

using MergeReport = std::map<std::string, RobotMerge>;  ///< by robot

/// Text of merge.json: {"robots": {NAME: {"status", "frame", "reason", "score", "map_from_frame" [x, y, θ],
/// "sigma" [m, rad], "time_s"}}}, null for what is unknown. Relations rounded to 1 µm and 1 µrad.
/// Deterministic.
std::string mergeText(const MergeReport& report);
/// Writes atomically. Throws std::runtime_error.
void writeMerge(const std::string& path, const MergeReport& report);
/// Throws std::runtime_error that names file and robot.
MergeReport readMerge(const std::string& path);

}  // namespace omnifleet::dataset
