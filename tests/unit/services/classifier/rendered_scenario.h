#pragma once

// Scenarios of Choi et al. 2014 §IV.2 in rendered arenas, and what the classifiers of a fleet made of them.

#include <set>
#include <string>
#include <vector>

#include "evaluation/classification.h"
#include "synthetic/arena.h"

namespace omnifleet::rendered {

struct Scenario {
  std::string name;
  std::string robots;             ///< the arena's `robots:`, with tables of speeds
  std::set<std::string> foreign;  ///< robots of nobody's fleet, without a camera, that publish nothing
  std::string pushed_by;          ///< the robot that pushes a box along, from the moment it drives
  double warm_up_s = 0.0;         ///< not counted: before a stranger has moved nobody can know
  double duration_s = 12.0;
  std::vector<Pose2> screens{};  ///< boxes that hide a robot behind them, ± some centimetres
};

/// Everybody straight on, turning, stopping and going on, one stopping, one standing since the start, a box
/// pushed along, a stranger that drives by.
std::vector<Scenario> scenarios();
/// Turning in place, stop and go, a long stop, two strangers, a robot and a stranger behind a box for
/// seconds.
std::vector<Scenario> moreScenarios();

/// Per visible track and frame, as `evaluate` counts it.
struct Score {
  evaluation::ClassCounts robots, obstacles;
  int nothing = 0;   ///< tracks near nothing true
  int switches = 0;  ///< a thing's track id changed
  Score& operator+=(const Score& other);
};

/// Obstacles (beside everybody's way), colours, light and noise are the seed's own.
Score run(const Scenario& scenario, unsigned seed);

}  // namespace omnifleet::rendered
