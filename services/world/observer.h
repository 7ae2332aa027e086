#pragma once

#include "observation/observation.h"
#include "world/world.h"

namespace omnifleet::world {

/// How far a robot's perfect eye reaches, and what its scan is like.
struct ObserverOptions {
  int rays = 360;
  double range_m = 2.5;    ///< m, beyond it the floor is all that is seen
  double sigma_m = 0.005;  ///< m, stated, not added
  double blind_m = 0.0;    ///< m, nearer to the robot obstacles are seen only as far as they stand out beyond
                           ///< (Scan::blind_m)
};

/// What a perfect camera would tell about the surroundings of one robot right now, by geometry alone: a scan
/// with settled labels and a track for every robot that is not hidden. Stands in for local mapper and
/// classifier where a recording is driven without them.
Objects observe(const World& world, std::size_t robot, const ObserverOptions& options = {});

/// What exact wheels would report of the way between two true poses. Covariance zero.
Motion exactMotion(const Pose2& map_from_previous, const Pose2& map_from_current, TimeNs since_ns);

/// The truth as the localizer would publish it.
std::vector<PoseEstimate> exactPoses(const World& world);

}  // namespace omnifleet::world
