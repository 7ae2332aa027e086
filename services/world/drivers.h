#pragma once

#include <map>
#include <string>
#include <vector>

#include "formation/formation.h"
#include "world/observer.h"
#include "world/world.h"

namespace omnifleet::world {

/// Drives the robots of an arena without cameras, for recordings, experiments and tests. Robots drive in the
/// formation of the arena, or else each to its own waypoints, on its tour, or open loop by its table of
/// speeds. The commands answer the previous frame, as in a run with all stages (CONTRIBUTING, "Determinism").
class Drivers {
 public:
  /// Throws options::Error when `formation:` of the arena is invalid.
  explicit Drivers(const World& world, const ObserverOptions& observer_options = {});

  /// Wheel speeds for the next step of the world, one per robot.
  const std::vector<motion::WheelSpeeds>& commands(const World& world);

  /// Latest state per robot. Robots with a tour or a table of speeds have none.
  const std::map<std::string, motion::FormationState>& states() const { return states_; }
  /// True when all robots with a goal have arrived and all commanded speeds are zero.
  bool arrived() const;

 private:
  motion::WheelSpeeds onTour(const World& world, std::size_t robot);
  motion::WheelSpeeds fromTable(const synthetic::ArenaRobot& robot, double time_s) const;

  ObserverOptions observer_options_;
  std::vector<formation::Formation>
      formations_;  ///< one per robot; unused for robots with a tour or a table of speeds
  std::vector<motion::WheelSpeeds> next_, commands_;
  std::vector<std::size_t> goal_;  ///< index in the tour per robot
  std::vector<Pose2> before_;
  std::vector<PoseEstimate> published_;
  std::vector<motion::FormationState> received_states_;
  TimeNs before_ns_ = 0;
  bool on_tour_ = false;  ///< a robot is on a tour, which does not end
  std::map<std::string, motion::FormationState> states_;
};

}  // namespace omnifleet::world
