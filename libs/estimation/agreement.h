#pragma once

#include <vector>

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// Something that the others know of.
struct Anchor {
  Eigen::Vector2d place_m;  ///< map frame
  double height_m, half_width_m;
  const RobotNode* robot;  ///< nullptr: an obstacle
  double theta_rad;
  bool sure;  ///< known well enough to be missed
};

/// Another robot, and what it saw last.
struct Company {
  const RobotNode* robot;
  Pose2 map_from_base;  ///< of the other then
  Pose2 way;            ///< from where the robot in question is now to where it was then, in its base_link
};

/// All against which the place of a robot can be held.
struct Surroundings {
  const RobotNode* robot;
  std::vector<Anchor> anchors;
  std::vector<Company> others;

  static Surroundings of(const FleetState& fleet, const RobotNode& robot);
};

struct Agreement {
  int matches = 0;  ///< things that it sees where others know them, and others that see it there
  int misses = 0;   ///< things in plain sight of one that only the other sees
  int score() const { return matches - misses; }
};

/// Of a robot at a place with what the others see and know.
Agreement agreementAt(const FleetState& fleet, const Surroundings& around, const Pose2& map_from_base);

struct Hypothesis {
  Pose2 map_from_base;
  Agreement agreement;
};

/// Other places where more agrees than is missing, the best first, each once: two robots that see each
/// other's body agree in distance, so position and heading follow (as locateBySightings); pairs of things
/// seen are at the distance of pairs of things known (as lookAround).
std::vector<Hypothesis> otherPlaces(const FleetState& fleet, const Surroundings& around);

/// Places in the observer's base_link where it sees what may be a body of this kind.
std::vector<Eigen::Vector2d> bodies(const FleetState& fleet, const RobotNode& observer, const Body& body);

/// Nothing is seen near a place in plain sight, and the floor there is: what should stand there is missing.
bool isMissing(const RobotNode& robot, const Eigen::Vector2d& in_base_m);

/// Places so near one another that nothing tells them apart before everything is estimated together.
bool areSame(const Pose2& a, const Pose2& b);

}  // namespace omnifleet::estimation
