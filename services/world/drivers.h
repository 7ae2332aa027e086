#pragma once

#include <map>
#include <string>
#include <vector>

#include "formation/formation.h"
#include "world/observer.h"
#include "world/world.h"

namespace omnifleet::world {

/// Drives the robots of an arena without any camera, for recordings, experiments and tests: in formation
/// where the arena has one, else each by its own waypoints or blindly by its table of speeds. The commands
/// answer the frame before, as in a run with all stages (CONTRIBUTING, "Determinism").
class Drivers {
 public:
  /// Throws options::Error when the arena's `formation:` is wrong.
  explicit Drivers(const World& world, const ObserverOptions& eyes = {});

  /// Wheel speeds for the next step of the world, one per robot.
  const std::vector<motion::WheelSpeeds>& commands(const World& world);

  /// Latest state per robot; robots that are driven blindly have none.
  const std::map<std::string, motion::FormationState>& states() const { return states_; }
  /// True once everybody who has a goal has arrived and has been told to stand.
  bool arrived() const;

 private:
  motion::WheelSpeeds fromTable(const synthetic::ArenaRobot& robot, double time_s) const;

  ObserverOptions eyes_;
  std::vector<formation::Formation> formations_;  ///< per robot; unused for robots with a table
  std::vector<motion::WheelSpeeds> next_, commands_;
  std::vector<Pose2> before_;
  std::vector<PoseEstimate> published_;
  std::vector<motion::FormationState> heard_;
  TimeNs before_ns_ = 0;
  std::map<std::string, motion::FormationState> states_;
};

}  // namespace omnifleet::world
