#pragma once

// Scenarios of Choi et al. 2014 §IV.2 in rendered arenas, and the scores of the fleet's classifiers.

#include <set>
#include <string>
#include <vector>

#include "evaluation/classification.h"
#include "synthetic/arena.h"

namespace omnifleet::rendered {

struct Scenario {
  std::string name;
  std::string robots;             ///< the arena's `robots:` section with tables of speeds
  std::set<std::string> foreign;  ///< unlisted robots, without a camera, that publish nothing
  std::string pushed_by;          ///< the robot that pushes a box as soon as it moves
  double warm_up_s = 0.0;         ///< s, not counted: an unlisted robot must move first
  double duration_s = 12.0;
  std::vector<Pose2>
      screens{};  ///< boxes that hide a robot behind them; the seed shifts them by some centimetres
};

/// All robots straight on, all turning, all stopping and going on, one stopping, one standing from the
/// beginning, a pushed box, an unlisted robot that drives by.
std::vector<Scenario> scenarios();
/// Turning in place, stop and go, a long stop, two unlisted robots, and a listed and an unlisted robot hidden
/// behind a box for seconds.
std::vector<Scenario> moreScenarios();

/// Counted per visible track and frame, as in `evaluate`.
struct Score {
  evaluation::ClassCounts robots, obstacles;
  int nothing = 0;   ///< tracks without a true object nearby
  int switches = 0;  ///< changes of an object's track id
  Score& operator+=(const Score& other);
};

/// The seed determines obstacles (beside the paths), colours, light and noise.
Score run(const Scenario& scenario, unsigned seed);

}  // namespace omnifleet::rendered
