// The part of Formation that hosts the behaviours beside the formation: boundary following and exploration
// (Ahmed et al. 2013 §3).

#include <algorithm>
#include <cmath>

#include "formation/formation.h"
#include "motion/view.h"

namespace omnifleet::formation {
namespace {

constexpr double kNearM = 1.2;    // m, remembered obstacles within this distance of the robot are considered
constexpr double kEdgeM = 0.015;  // m, as in compactView()
constexpr double kSameRayM = 0.05;  // m, an obstacle this near a ray explains what the ray hits
constexpr double kMeetM = 0.8;      // m, a robot within this distance may be in the way
constexpr double kUnknownM = 0.25;  // m beyond the body, farther than it needs to stop
constexpr double kRayStepM = 0.01;
constexpr double kStoppedRad = 1e-3;

double towards(double from, double to, double most) {
  return from + std::clamp(to - from, -most, most);
}

/// Adds unknown floor outside the circle in which the body can turn: the robot turns and looks before it
/// drives there. The body may come up to unknown floor; obstacles there begin at their own hits.
void addUnknown(const motion::ExplorationGrid& grid, const Pose2& map_from_base, double reach_m,
                double margin_m, std::vector<Eigen::Vector2d>& points_m) {
  const double turning_m = reach_m + grid.cell_m();
  const Pose2 base_from_map = map_from_base.inverse();
  const int reach = static_cast<int>(std::ceil((turning_m + kUnknownM) / grid.cell_m()));
  const Eigen::Vector2i here = grid.cellOf(map_from_base.translation());
  for (int row = -reach; row <= reach; ++row) {
    for (int column = -reach; column <= reach; ++column) {
      const Eigen::Vector2i cell = here + Eigen::Vector2i(column, row);
      if (!grid.isInside(cell) || grid.at(cell) != motion::Cell::kUnknown) continue;
      const Eigen::Vector2d place_m = base_from_map * grid.centreOf(cell);
      if (place_m.norm() > turning_m) points_m.push_back(place_m * (1.0 + margin_m / place_m.norm()));
    }
  }
}

}  // namespace

void Formation::park(const std::map<std::string, Pose2>& map_from_bases) {
  parked_ = map_from_bases;
  shared_.park(map_from_bases);
}

/// The own state is used once it is published, like those of the others.
void Formation::updateShared(const std::vector<PoseEstimate>& poses,
                             const std::vector<motion::FormationState>& states) {
  std::vector<motion::FormationState> all;
  for (const motion::FormationState& state : states) {
    if (state.robot != robot_) all.push_back(state);
  }
  if (published_) all.push_back(*published_);
  shared_.learn(poses, all);
}

std::optional<Pose2> Formation::poseOf(const std::string& robot, TimeNs now_ns) const {
  if (const auto pose = fleet_.now(robot, now_ns)) return pose;
  const auto parked = parked_.find(robot);
  return parked == parked_.end() ? std::nullopt : std::optional<Pose2>(parked->second);
}

/// One frame of a behaviour beside the formation.
void Formation::behave(const Objects& objects, Output& output) {
  const bool explores = options_.command.behaviour == motion::Behaviour::kExploration;
  output.state.skipped = explores ? explorer_.skipped() : std::vector<motion::SkippedFrontier>{};
  const auto own = fleet_.now(robot_, objects.acquired_ns);
  if (objects.state != FrameState::kOk || options_.command.halt || !own) {
    commanded_ = {};
    return;
  }
  output.state.view = motion::compactView(objects.scan, options_.grid.hit_cells * options_.grid.cell_m);
  updateBarriers(objects, *own);
  const motion::BoundaryLaw::Result ground = boundary_.follow(barriers_, options_.command.boundary_m);
  output.state.ground_clear = ground.clear;
  const motion::Twist wanted =
      explores ? explore(*own, objects.acquired_ns, output) : followBoundary(ground, output);
  const motion::DriveLimits& limits = options_.limits;
  const motion::Twist smooth{
      towards(commanded_.forward_mps, wanted.forward_mps, limits.max_mps2 * dt_s_),
      towards(commanded_.turn_radps, wanted.turn_radps, limits.max_turn_radps2 * dt_s_)};
  // Explored paths avoid unknown floor. A boundary leads around corners into it.
  if (!explores)
    addUnknown(shared_.grid(), *own, motion::reachOf(bodies_.at(robot_).outline()), options_.guard.margin_m,
               barriers_.points_m);
  const motion::MotionGuard::Result guarded = guard_.limit(smooth, commanded_, dt_s_, barriers_);
  held_ = guarded.limited && guarded.twist.forward_mps == 0.0 && smooth.forward_mps != 0.0;
  commanded_ = guarded.twist;
  output.state.stop = guarded.stop;
  output.state.avoiding = guarded.limited || (!explores && !ground.clear);
}

/// What this robot must not touch: what it sees and remembers, and the other robots.
void Formation::updateBarriers(const Objects& objects, const Pose2& map_from_base) {
  const Pose2 base_from_map = map_from_base.inverse();
  barriers_.points_m = near_field_.points_m();
  barriers_.solids.clear();
  remembered_m_.clear();
  shared_.grid().occupiedNear(map_from_base.translation(), kNearM, remembered_m_);
  for (const Eigen::Vector2d& centre_m : remembered_m_)
    barriers_.points_m.push_back(base_from_map * centre_m);
  addScan(objects.scan);
  std::vector<Polygon> places_m;
  for (const auto& [name, body] : bodies_) {
    const auto pose = name == robot_ ? std::nullopt : poseOf(name, objects.acquired_ns);
    if (!pose) continue;
    places_m.push_back(motion::placed(base_from_map * *pose, body.outline()));
    barriers_.solids.push_back(reserved(name, *pose, base_from_map));
  }
  for (const Track& track : objects.tracks) {
    const bool named = std::any_of(places_m.begin(), places_m.end(), [&](const Polygon& place) {
      return distanceTo(place, track.position_m) <= options_.gate_m;
    });
    if (track.kind != ObjectKind::kRobot || named) continue;
    double widest_m = 0.0;
    for (const auto& [name, body] : bodies_) widest_m = std::max(widest_m, motion::reachOf(body.outline()));
    barriers_.solids.push_back({circlePolygon(track.position_m, widest_m, 16), options_.robot_margin_m});
  }
  auto& points_m = barriers_.points_m;
  points_m.erase(std::remove_if(points_m.begin(), points_m.end(),
                                [&](const Eigen::Vector2d& point_m) {
                                  return std::any_of(places_m.begin(), places_m.end(), [&](const Polygon& p) {
                                    return distanceTo(p, point_m) <= options_.own_points_m;
                                  });
                                }),
                 points_m.end());
}

/// The hits of the present scan. An object within the floor that the body hides may begin anywhere before the
/// range of its rays. If nothing remembered explains it, it begins at the circle that the body needs to turn.
void Formation::addScan(const Scan& scan) {
  const std::size_t known = barriers_.points_m.size();
  const double step_rad = 2.0 * M_PI / static_cast<double>(std::max<std::size_t>(1, scan.range_m.size()));
  const double turning_m = motion::reachOf(bodies_.at(robot_).outline()) + options_.guard.margin_m;
  for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
    const double range_m = scan.range_m[i], bearing_rad = step_rad * static_cast<double>(i);
    if (!isSolid(scan.label[i]) || !(range_m <= kNearM)) continue;
    const Eigen::Vector2d unit(std::cos(bearing_rad), std::sin(bearing_rad));
    if (range_m > scan.blind_m + kEdgeM) {
      barriers_.points_m.push_back(scan.origin_m + range_m * unit);
      continue;
    }
    const auto explains = [&](const Eigen::Vector2d& point_m) {
      const Eigen::Vector2d way_m = point_m - scan.origin_m;
      const double along_m = way_m.dot(unit);
      return along_m > 0.0 && along_m <= range_m + kSameRayM && (way_m - along_m * unit).norm() <= kSameRayM;
    };
    const auto end = barriers_.points_m.begin() + static_cast<std::ptrdiff_t>(known);
    if (std::any_of(barriers_.points_m.begin(), end, explains)) continue;
    double along_m = 0.0;
    while (along_m < range_m && (scan.origin_m + along_m * unit).norm() <= turning_m) along_m += kRayStepM;
    barriers_.points_m.push_back(scan.origin_m + along_m * unit);
  }
}

/// The floor that another robot may use until its next state is known. It announces where it stands if it
/// brakes. Of two robots the later one by name leaves the other room to extend this by one frame. A robot
/// without such a state keeps its velocity for two frames and brakes.
motion::Barriers::Solid Formation::reserved(const std::string& name, const Pose2& map_from_other,
                                            const Pose2& base_from_map) const {
  const Polygon outline_m = bodies_.at(name).outline();
  const auto stated = shared_.stated().find(name);
  const bool announces = stated != shared_.stated().end() &&
                         stated->second.state.behaviour != motion::Behaviour::kFormation &&
                         seconds(stated->second.state.acquired_ns, frame_ns_) <= options_.pose_age_limit_s;
  const double v_mps = options_.limits.cruise_mps, braking_mps2 = options_.guard.braking_mps2;
  if (announces) {
    const Pose2& from = stated->second.map_from_base;
    const Polygon swept_m =
        motion::hullOf(motion::placed(base_from_map * from, outline_m),
                       motion::placed(base_from_map * from * stated->second.state.stop, outline_m));
    const double extension_m = name < robot_ ? v_mps * dt_s_ + v_mps * v_mps / (2.0 * braking_mps2) : 0.0;
    return {swept_m, options_.robot_margin_m + extension_m};
  }
  const motion::Twist twist = fleet_.twist(name);
  const double until_s = 2.0 * dt_s_ + std::abs(twist.forward_mps) / (2.0 * braking_mps2);
  const Pose2 later = advanced(map_from_other, twist, until_s);
  return {motion::hullOf(motion::placed(base_from_map * map_from_other, outline_m),
                         motion::placed(base_from_map * later, outline_m)),
          options_.robot_margin_m};
}

motion::Twist Formation::explore(const Pose2& map_from_base, TimeNs now_ns, Output& output) {
  Explorer::Frame frame;
  frame.acquired_ns = now_ns;
  frame.dt_s = dt_s_;
  frame.map_from_base = map_from_base;
  frame.held = held_;
  for (const motion::Barriers::Solid& solid : barriers_.solids)
    frame.solids.push_back({motion::placed(map_from_base, solid.outline_m), solid.margin_m});
  double least_m = kMeetM;
  for (const auto& [name, stated] : shared_.stated()) {
    const auto pose = name == robot_ ? std::nullopt : fleet_.now(name, now_ns);
    if (!pose || (pose->translation() - map_from_base.translation()).norm() >= least_m) continue;
    least_m = (pose->translation() - map_from_base.translation()).norm();
    frame.nearest_m = pose->translation();
    frame.nearest_first = name < robot_;
    frame.nearest_goal_m.reset();
    if (stated.state.has_goal) frame.nearest_goal_m = stated.state.goal_m;
  }
  const Explorer::Drive drive = explorer_.drive(frame, shared_);
  output.state.skipped = explorer_.skipped();
  output.state.frontiers = explorer_.frontiers();
  output.state.has_goal = drive.goal_m.has_value();
  if (drive.goal_m) {
    output.state.goal_m = *drive.goal_m;
    output.state.target_m = map_from_base.inverse() * *drive.goal_m;
  }
  output.state.arrived =
      drive.explored && commanded_.forward_mps == 0.0 && std::abs(commanded_.turn_radps) < kStoppedRad;
  return drive.twist;
}

/// Ahmed et al. 2013 §2.1: while the ground ahead is not clear, avoidance acts and the frame is not mapped.
motion::Twist Formation::followBoundary(const motion::BoundaryLaw::Result& ground, Output& output) {
  const motion::DriveLimits& limits = options_.limits;
  if (!ground.clear) {
    output.state.view.ray.clear();
    return {0.0, ground.turn * limits.lead_turn_radps};
  }
  output.state.distance_error_m = ground.follows ? ground.distance_m - options_.command.boundary_m : 0.0;
  const double ahead = std::max(0.0, std::cos(ground.heading_rad));
  return {limits.cruise_mps * ahead * ahead, std::clamp(limits.turn_gain_per_s * ground.heading_rad,
                                                        -limits.max_turn_radps, limits.max_turn_radps)};
}

}  // namespace omnifleet::formation
