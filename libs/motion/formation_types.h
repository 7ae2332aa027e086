#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/pose2.h"
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

/// What the robots do. The order of the enumerators is that of the wire format.
enum class Behaviour : std::uint8_t {
  kFormation = 0,      ///< keep the formation
  kBoundaryFollowing,  ///< each robot follows the boundary of the free floor (Ahmed et al. 2013 §3)
  kExploration,        ///< together until nothing reachable is unknown
};
const char* toString(Behaviour behaviour);
/// The names of all behaviours, in the order of the enumerators.
const std::vector<std::string>& behaviourNames();

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
  Behaviour behaviour = Behaviour::kFormation;
  double boundary_m = 0.30;  ///< boundary following: distance of base_link to the boundary
};

/// The scan of one frame, compactly, for the exploration grids of all robots. Entry i has bearing `first_rad`
/// + i · `step_rad` and stands for the rays up to half a step beside it. Empty: the frame shows nothing.
struct View {
  /// What a ray shows, in the high two bits of an entry; the low 14 bits are the range in millimetres.
  enum Kind : std::uint16_t { kNothing = 0, kFree = 1, kSolid = 2, kSolidNear = 3 };
  static constexpr int kRangeBits = 14;
  static constexpr std::size_t kMostRays = 96;

  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();  ///< foot of the camera or laser, base_link
  float blind_m = 0.0f;                                ///< as Scan::blind_m
  float first_rad = 0.0f, step_rad = 0.0f;             ///< base_link
  std::vector<std::uint16_t> ray;

  static std::uint16_t entry(Kind kind, double range_m);
  Kind kind(std::size_t i) const { return static_cast<Kind>(ray[i] >> kRangeBits); }
  double range_m(std::size_t i) const { return 1e-3 * (ray[i] & ((1u << kRangeBits) - 1u)); }
  double bearing_rad(std::size_t i) const { return first_rad + step_rad * static_cast<double>(i); }
};

/// A frontier that a robot has given up.
struct SkippedFrontier {
  static constexpr std::size_t kMost = 32;  ///< per robot

  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();  ///< map
  /// True: it was in view and stays unknown, final for all robots. False: this robot finds no way there.
  bool looked = false;
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
  Behaviour behaviour = Behaviour::kFormation;  ///< in force
  bool ground_clear = false;  ///< the ground ahead is clear: the frame may be mapped (Ahmed et al. 2013 §2.1)
  /// Where the robot stands if it brakes after the command of this frame, base_link of this frame. Boundary
  /// following and exploration; the formation leaves it zero.
  Pose2 stop;
  bool has_goal = false;  ///< exploration: the robot heads for the frontier `goal_m`
  Eigen::Vector2d goal_m = Eigen::Vector2d::Zero();  ///< map
  std::uint32_t frontiers = 0;                       ///< exploration: reachable frontiers left, of all robots
  View view;                                         ///< exploration: of this frame
  std::vector<SkippedFrontier> skipped;              ///< exploration
};

/// Desired wheel speeds of one robot, computed from the frame at `acquired_ns`.
struct WheelCommand {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  WheelSpeeds speeds;
};

}  // namespace omnifleet::motion
