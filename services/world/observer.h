#pragma once

#include "observation/observation.h"
#include "world/world.h"

namespace omnifleet::world {

/// Range and scan properties of the ideal observer.
struct ObserverOptions {
  int rays = 360;
  double range_m = 2.5;    ///< m; rays without a hit end on the floor at this range
  double sigma_m = 0.005;  ///< m; stated in the scan, not added as noise
  double blind_m = 0.0;    ///< m; nearer parts of obstacles are invisible (Scan::blind_m)
};

/// The objects that an ideal camera of one robot would report now, computed by geometry alone: a scan with
/// final labels and a track for every robot that is not hidden. Replaces local mapper and classifier where a
/// recording is driven without them.
Objects observe(const World& world, std::size_t robot, const ObserverOptions& options = {});

/// The motion that ideal wheels would report between two true poses. Covariance zero.
Motion exactMotion(const Pose2& map_from_previous, const Pose2& map_from_current, TimeNs since_ns);

/// The true poses in the form that the localizer publishes.
std::vector<PoseEstimate> exactPoses(const World& world);

}  // namespace omnifleet::world
