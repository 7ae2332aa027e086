#pragma once

// Fleets among five obstacles, what they contribute, and how well a merger's objects fit the truth.

#include <map>
#include <string>
#include <vector>

#include "global_merger/merger.h"
#include "tests/unit/occupancy/fleet_sim.h"

namespace omnifleet::global_merger::testing {

using omnifleet::testing::FleetSim;
using omnifleet::testing::SimOptions;
using omnifleet::testing::SimThing;

std::vector<SimThing> fiveObstacles();
/// Three robots among them; the third stands all the time.
FleetSim arena(SimOptions options, unsigned seed, std::vector<SimThing> things = fiveObstacles());
SimOptions noisy();

struct Sets {
  std::vector<occupancy::Contribution> contributions;
  std::vector<occupancy::KeyframePose> poses;
};
Sets record(FleetSim& sim, double from_s, double to_s, double step_s = 0.2);
Merger merged(const Sets& sets, const std::map<std::string, RobotBody>& bodies,
              const MergerOptions& options = {});

/// Objects and true things paired by centroid (15 cm); means over the pairs.
struct Score {
  int matched = 0, missed = 0, extra = 0;
  double error_m = 0.0, iou = 0.0, height_m = 0.0;
};
Score score(const std::vector<dataset::MapObject>& objects, const std::vector<SimThing>& truth);
/// As objects.geojson.
std::string text(Merger& merger);

}  // namespace omnifleet::global_merger::testing
