#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "observation/observation.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::estimation::testing {

/// Robots r1, r2, … that drive along one circle of 0.75 m, each from another place on it, with a scan and
/// wheel odometry per frame. Paths and scans are closed forms with seeded noise (0.003 1/m of a scan); the
/// wheels err by 3 % of travel and turn.
class CirclingRobots {
 public:
  /// @param rooms of r1, r2, … (at most three robots), in which their scans are made
  CirclingRobots(std::vector<scan::testing::Scene> rooms, int frames, std::uint32_t seed = 5);

  static std::string name(std::size_t robot) { return "r" + std::to_string(robot + 1); }
  static TimeNs time(std::size_t frame) { return static_cast<TimeNs>(frame + 1) * kPeriod_ns; }
  static constexpr TimeNs kPeriod_ns = 200'000'000;

  /// r1 has its true initial pose, the others have none.
  std::vector<RobotSetup> setups() const;
  /// Of one robot; draws noise, so the order of calls matters.
  Objects frame(std::size_t robot, std::size_t i);
  /// True room_from_base of all frames.
  const std::vector<Pose2>& path(std::size_t robot) const { return paths_[robot]; }

 private:
  std::vector<scan::testing::Scene> rooms_;
  std::vector<std::vector<Pose2>> paths_;
  std::mt19937 random_;
};

/// The walls of scan::testing::furnishedRoom() with other furniture.
scan::testing::Scene lookAlikeRoom();

}  // namespace omnifleet::estimation::testing
