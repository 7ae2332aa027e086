#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "motion/wheeled_model.h"
#include "observation/observation.h"

namespace omnifleet::motion {

/// Choi et al. 2014 §IV.3, Fig. 12. The order of the enumerators is that of the wire format.
enum class FormationShape : std::uint8_t {
  kLine = 0,  ///< abreast
  kColumn,    ///< one behind the other
  kWedge,     ///< a V behind the leader, opened by θ
  kTriangle,  ///< rows of one, two, three …, equilateral
};
const char* toString(FormationShape shape);

enum class FormationRole : std::uint8_t { kLeader = 0, kFollower, kIdle };

/// Command of an operator to the fleet.
struct FormationCommand {
  std::string fleet;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  FormationShape shape = FormationShape::kWedge;
  double distance_m = 0.8;  ///< d: distance to the centre of the followed object
  double angle_rad = 0.6;   ///< θ: angle between that object and the own heading
  std::vector<Eigen::Vector2d>
      waypoints_m;    ///< map; the last one is the goal; empty: the waypoints in force stay
  bool halt = false;  ///< stop at the current place until the next command
};

/// State that each robot publishes, one per frame.
struct FormationState {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  FormationRole role = FormationRole::kIdle;
  std::string leader;
  double distance_error_m = 0.0;  ///< distance to the followed object minus d (0 for the leader)
  double angle_error_rad = 0.0;   ///< its bearing minus θ
  Eigen::Vector2d target_m = Eigen::Vector2d::Zero();  ///< place to keep, or waypoint; base_link
  bool avoiding = false;
  bool arrived = false;
  std::uint32_t term = 0;           ///< of the leader that this robot follows; increases with every failover
  std::uint32_t next_waypoint = 0;  ///< index of the waypoint that the leader heads for
  TimeNs command_ns = 0;            ///< header time of the command in force; 0: from the fleet file
  double narrowing = 0.0;           ///< 0: at the commanded place; 1: on the trail of the followed robot
};

/// Desired wheel speeds of one robot, computed from the frame at `acquired_ns`.
struct WheelCommand {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  WheelSpeeds speeds;
};

}  // namespace omnifleet::motion
