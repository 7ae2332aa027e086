#pragma once

// Fleets among five obstacles, their contributions, and a score of a merger's objects against the truth.

#include <map>
#include <string>
#include <vector>

#include "global_merger/merger.h"
#include "global_merger/verdict.h"
#include "tests/unit/occupancy/fleet_sim.h"

namespace omnifleet::global_merger::testing {

using omnifleet::testing::FleetSim;
using omnifleet::testing::SimObstacle;
using omnifleet::testing::SimOptions;

std::vector<SimObstacle> fiveObstacles();
/// Three robots among the obstacles; the third is stationary.
FleetSim arena(SimOptions options, unsigned seed, std::vector<SimObstacle> obstacles = fiveObstacles());
SimOptions noisy();

struct Sets {
  std::vector<occupancy::Contribution> contributions;
  std::vector<occupancy::KeyframePose> poses;
};
Sets record(FleetSim& sim, double from_s, double to_s, double step_s = 0.2);
Merger merged(const Sets& sets, const std::map<std::string, RobotBody>& bodies,
              const MergerOptions& options = {});

/// Obstacles (not structure) and true obstacles paired by centroid (15 cm); means over the pairs.
struct Score {
  int matched = 0, missed = 0, extra = 0;
  double error_m = 0.0, iou = 0.0, height_m = 0.0;
};
Score score(const std::vector<dataset::MapObject>& objects, const std::vector<SimObstacle>& truth);
/// The obstacles among the outlines, without structure.
std::vector<dataset::MapObject> obstaclesOf(Merger& merger);
/// Centroids of the objects with this flag.
std::vector<Eigen::Vector2d> flagged(Merger& merger, Quality quality);
/// Content of objects.geojson.
std::string text(Merger& merger);

}  // namespace omnifleet::global_merger::testing
