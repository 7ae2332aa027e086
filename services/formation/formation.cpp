#include "formation/formation.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>
#include <tuple>

namespace omnifleet::formation {
namespace {

constexpr double kFirstStepS = 0.1;    // s, until two frames determine the period
constexpr double kLongestStepS = 0.5;  // s, bounds the step after a gap in the frames
constexpr double kJumpM = 0.15,
                 kJumpRad = 0.1;    // larger pose corrections are treated as relocalization
constexpr double kStuckS = 1.0;     // s, a waypoint that is unreachable for this long is skipped
constexpr double kReachedM = 0.10;  // m, the end of a path within this distance is reached

double reach(const RobotBody& body) {
  double reach_m = body.radius_m;
  for (const Eigen::Vector2d& vertex : body.footprint_m) reach_m = std::max(reach_m, vertex.norm());
  return reach_m;
}

/// The configured leader, then all others by name.
std::vector<std::string> orderOf(const std::map<std::string, RobotBody>& bodies, const std::string& robot,
                                 const std::string& leader) {
  if (!bodies.count(robot)) throw std::runtime_error("formation: robot " + robot + " is not in the fleet");
  const std::string first = leader.empty() ? bodies.begin()->first : leader;
  if (!bodies.count(first)) throw std::runtime_error("formation: leader " + first + " is not in the fleet");
  std::vector<std::string> order{first};
  for (const auto& [name, body] : bodies) {
    if (name != first) order.push_back(name);
  }
  return order;
}

double toSegment(const Eigen::Vector2d& point, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d way = b - a;
  const double along = std::clamp((point - a).dot(way) / std::max(1e-9, way.squaredNorm()), 0.0, 1.0);
  return (point - a - along * way).norm();
}

}  // namespace

Formation::Options Formation::Options::read(const options::Section& section) {
  Options options;
  std::string shape = "wedge";
  const std::vector<std::string> shapes{"line", "column", "wedge", "triangle"};
  section.read("shape", shape, shapes);
  options.command.shape =
      static_cast<motion::FormationShape>(std::find(shapes.begin(), shapes.end(), shape) - shapes.begin());
  section.read("distance_m", options.command.distance_m, {0.1, 20.0});
  section.read("angle_rad", options.command.angle_rad, {0.0, M_PI});
  section.read("waypoints", options.command.waypoints_m);
  section.read("leader", options.leader);
  std::string behaviour = motion::toString(options.command.behaviour);
  const std::vector<std::string>& behaviours = motion::behaviourNames();
  section.read("behaviour", behaviour, behaviours);
  options.command.behaviour = static_cast<motion::Behaviour>(
      std::find(behaviours.begin(), behaviours.end(), behaviour) - behaviours.begin());
  section.read("boundary_m", options.command.boundary_m, {0.05, 5.0});
  options.boundary = motion::BoundaryLaw::Options::read(section.child("boundary"));
  options.grid = motion::ExplorationGrid::Options::read(section.child("grid"));
  options.exploration = Explorer::Options::read(section.child("exploration"));
  options.guard = motion::MotionGuard::Options::read(section.child("guard"));
  section.read("robot_margin_m", options.robot_margin_m, {0.0, 2.0});
  options.limits = motion::DriveLimits::read(section.child("limits"));
  options.follow = motion::FollowLaw::Options::read(section.child("follow"));
  options.lead = motion::LeadLaw::Options::read(section.child("lead"));
  options.avoidance = motion::Avoidance::Options::read(section.child("avoidance"));
  options.memory = motion::FloorMemory::Options::read(section.child("memory"));
  options.route = motion::Route::Options::read(section.child("route"));
  options.narrowing = motion::Narrowing::Options::read(section.child("narrowing"));
  options.leader_failover = motion::LeaderFailover::Options::read(section.child("leader_failover"));
  section.read("gate_m", options.gate_m, {0.01, 5.0});
  section.read("own_points_m", options.own_points_m, {0.0, 2.0});
  section.read("published_poses", options.published_poses);
  section.read("pose_age_limit_s", options.pose_age_limit_s, options::kPositive);
  section.read("unseen_limit_s", options.unseen_limit_s, options::kPositive);
  section.finish();
  return options;
}

Formation::Formation(const std::string& robot, const std::map<std::string, RobotBody>& bodies,
                     const Options& options)
    : robot_(robot),
      bodies_(bodies),
      options_(options),
      leader_failover_(options.leader_failover, robot, orderOf(bodies, robot, options.leader)),
      follow_(options.follow),
      lead_(options.lead),
      avoidance_(options.avoidance),
      narrowing_(options.narrowing),
      memory_(options.memory),
      route_(options.route),
      fleet_(robot, options.pose_age_limit_s, options.published_poses),
      boundary_(options.boundary, bodies.at(robot).outline()),
      guard_(options.guard, bodies.at(robot).outline()),
      shared_(options.grid, bodies),
      explorer_(robot, bodies, options.exploration, options.limits) {
  lead_.follow(options.command.waypoints_m);
}

bool Formation::command(const motion::FormationCommand& command) {
  const motion::FormationCommand& now = options_.command;
  if (!now.fleet.empty() && command.fleet != now.fleet) return false;
  if (std::tie(command.acquired_ns, command.sequence) <= std::tie(now.acquired_ns, now.sequence))
    return false;
  std::vector<Eigen::Vector2d> way_m = now.waypoints_m;
  if (command.behaviour != now.behaviour) explorer_.restart();
  options_.command = command;
  if (command.waypoints_m.empty()) {
    options_.command.waypoints_m = std::move(way_m);
  } else {
    lead_.follow(command.waypoints_m);
  }
  return true;
}

Formation::Output Formation::process(const Objects& objects, const std::vector<PoseEstimate>& poses,
                                     const std::vector<motion::FormationState>& states) {
  applyMotion(objects);
  fleet_.learn(poses);
  if (const auto own = fleet_.now(robot_, objects.acquired_ns)) trail_.setPose(*own);
  updateLeader(states, objects.acquired_ns);
  updateShared(poses, states);
  Output output;
  output.command = {robot_, objects.acquired_ns, objects.sequence, {}};
  output.state.robot = robot_;
  output.state.acquired_ns = objects.acquired_ns;
  output.state.sequence = objects.sequence;
  output.state.leader = leader_failover_.leader();
  output.state.term = leader_failover_.term();
  output.state.role = rank_ == 0 ? motion::FormationRole::kLeader : motion::FormationRole::kFollower;
  output.state.command_ns = options_.command.acquired_ns;
  output.state.behaviour = options_.command.behaviour;
  const bool formation = options_.command.behaviour == motion::Behaviour::kFormation;
  const bool idle = (formation && options_.command.waypoints_m.empty()) || options_.command.halt;
  if (idle) output.state.role = motion::FormationRole::kIdle;
  if (!formation) {
    behave(objects, output);
  } else if (objects.state != FrameState::kOk || idle) {
    commanded_ = {};
  } else {
    updateSurroundings(objects);
    rank_ == 0 ? lead(objects, output) : follow(objects, output);
  }
  output.state.next_waypoint = static_cast<std::uint32_t>(lead_.next());
  output.command.speeds = motion::wheelsFromTwist(commanded_, bodies_.at(robot_).wheel_separation_m);
  published_ = output.state;
  return output;
}

void Formation::applyMotion(const Objects& objects) {
  const TimeNs now_ns = objects.acquired_ns;
  dt_s_ = frame_ns_ > 0 ? std::clamp(seconds(frame_ns_, now_ns), 0.0, kLongestStepS) : kFirstStepS;
  frame_ns_ = now_ns;
  // Without valid wheel motion, the robot is assumed to have followed its last command.
  Pose2 step = advanced(Pose2{}, commanded_, dt_s_);
  TimeNs since_ns = now_ns - static_cast<TimeNs>(std::llround(dt_s_ * 1e9));
  if (objects.motion.valid) {
    step = objects.motion.previous_from_current;
    since_ns = objects.motion.since_ns;
  }
  fleet_.moved(since_ns, now_ns, step);
  trail_.moved(step);
  near_field_.moved(step);
  if (objects.state == FrameState::kOk) near_field_.see(objects.scan);
  turned_rad_ = step.theta_rad;
  if (propagated_pose_) propagated_pose_ = *propagated_pose_ * step;
  if (!last_followed_) return;
  // To the new base_link, propagated by the robot's own speed.
  const Pose2 old{last_followed_->position_m.x(), last_followed_->position_m.y(),
                  last_followed_->heading_rad};
  const Pose2 now = step.inverse() * advanced(old, last_followed_->twist, dt_s_);
  last_followed_->position_m = now.translation();
  last_followed_->heading_rad = now.theta_rad;
}

/// Determines the leader and how far the formation has come on its path.
void Formation::updateLeader(const std::vector<motion::FormationState>& states, TimeNs now_ns) {
  for (const motion::FormationState& state : states) leader_failover_.receive(state);
  leader_failover_.settle(now_ns);
  for (const auto& [robot, state] : leader_failover_.received()) {
    const bool same_path =
        state.leader == leader_failover_.leader() && state.command_ns == options_.command.acquired_ns;
    if (same_path) lead_.skipTo(state.next_waypoint);
  }
  const std::vector<std::string>& ranks = leader_failover_.ranks();
  rank_ = static_cast<std::size_t>(std::find(ranks.begin(), ranks.end(), robot_) - ranks.begin());
  if (rank_ == 0) return;
  if (const auto leader = fleet_.now(leader_failover_.leader(), now_ns)) lead_.passed(leader->translation());
}

void Formation::updateSurroundings(const Objects& objects) {
  const double own_m = reach(bodies_.at(robot_));
  double widest_m = 0.0;
  for (const auto& [name, body] : bodies_) widest_m = std::max(widest_m, reach(body));
  motion::surroundingsFrom(objects, own_m, widest_m, around_);
  classifyRobots(objects.acquired_ns);
  for (const motion::Neighbour& robot : around_.robots)
    near_field_.clear(robot.position_m, robot.radius_m + options_.own_points_m);
  around_.points_m.insert(around_.points_m.end(), near_field_.points_m().begin(),
                          near_field_.points_m().end());
  updateMemory(objects);
}

/// Adds the scan to the memory used for path search. After a relocalization the memory is cleared, because
/// its contents refer to the old pose.
void Formation::updateMemory(const Objects& objects) {
  const auto own = fleet_.now(robot_, objects.acquired_ns);
  if (!own) return;
  if (propagated_pose_) {
    const Pose2 off = propagated_pose_->inverse() * *own;
    if (off.translation().norm() > kJumpM || std::abs(off.theta_rad) > kJumpRad) memory_.forget();
  }
  propagated_pose_ = own;
  memory_.see(*own, objects.scan);
  for (const motion::Neighbour& robot : around_.robots)
    memory_.clear(*own * robot.position_m, robot.radius_m + options_.own_points_m);
}

/// Adds the robots around this one, from their published poses.
void Formation::classifyRobots(TimeNs now_ns) {
  const auto own = fleet_.now(robot_, now_ns);
  if (!own) return;
  for (const auto& [name, body] : bodies_) {
    if (name == robot_) continue;
    const auto other = fleet_.now(name, now_ns);
    if (!other) continue;
    const Pose2 base_from_other = own->inverse() * *other;
    const Eigen::Vector2d place_m = base_from_other.translation();
    const double reach_m = reach(body);
    auto& robots = around_.robots;
    const auto seen = std::find_if(robots.begin(), robots.end(), [&](const motion::Neighbour& neighbour) {
      return (neighbour.position_m - place_m).norm() < options_.gate_m;
    });
    const Eigen::Vector2d velocity_mps = base_from_other.rotation().col(0) * fleet_.twist(name).forward_mps;
    // The published speed is more accurate than that of the track, whose blob may merge with others for a
    // frame.
    if (seen != robots.end())
      seen->velocity_mps = velocity_mps;
    else
      robots.push_back({place_m, velocity_mps, reach_m});
    // Points of unknown objects at a robot's published place belong to that robot.
    auto& points = around_.points_m;
    points.erase(std::remove_if(points.begin(), points.end(),
                                [&](const Eigen::Vector2d& point) {
                                  return (point - place_m).norm() < reach_m + options_.own_points_m;
                                }),
                 points.end());
  }
}

double Formation::worstFollower(TimeNs now_ns) const {
  const auto own = fleet_.now(robot_, now_ns);
  if (!own) return 0.0;
  const std::vector<std::string>& ranks = leader_failover_.ranks();
  const motion::FormationCommand& command = options_.command;
  const std::vector<Eigen::Vector2d> places = motion::placesOf(command, ranks.size());
  double worst_m = 0.0;
  for (std::size_t rank = 1; rank < ranks.size(); ++rank) {
    const auto other = fleet_.now(ranks[rank], now_ns);
    if (!other) continue;
    const motion::Slot slot = motion::slotOf(command.shape, rank, command.distance_m, command.angle_rad);
    if (motion::isQueue(slot)) {
      // In a queue, the position error is only the distance fallen back. Waiting for a straight queue would
      // block it, because it straightens by driving on.
      const auto before = fleet_.now(ranks[slot.followed], now_ns);
      if (before)
        worst_m = std::max(worst_m, (other->translation() - before->translation()).norm() - slot.distance_m);
      continue;
    }
    // In its place, or moved in towards the queue behind the robot that it follows.
    const Eigen::Vector2d queue_m =
        places[slot.followed] - Eigen::Vector2d(narrowing_.queueLength(slot, rank), 0.0);
    worst_m = std::max(worst_m, toSegment(own->inverse() * other->translation(), places[rank], queue_m));
  }
  return worst_m;
}

void Formation::lead(const Objects& objects, Output& output) {
  last_followed_.reset();
  const auto own = fleet_.now(robot_, objects.acquired_ns);
  if (!own) {
    drive(Eigen::Vector2d::Zero(), 0.0, options_.limits.lead_turn_radps, output);
    return;
  }
  const std::optional<motion::Route::Leg> leg = nextLeg(*own);
  Eigen::Vector2d wanted_mps = Eigen::Vector2d::Zero();
  double way_m = 0.0;
  if (leg) {
    wanted_mps =
        lead_.wanted(*own, worstFollower(objects.acquired_ns), options_.limits.cruise_mps, leg->via_m);
    way_m = (leg->via_m - own->translation()).norm();
  }
  if (const auto waypoint = lead_.waypoint()) output.state.target_m = own->inverse() * *waypoint;
  drive(wanted_mps, 0.0, options_.limits.lead_turn_radps, output, way_m);
  output.state.avoiding |= leg && !leg->straight;
  output.state.arrived = lead_.arrived();
}

/// The next leg; nothing at the goal or if the robot cannot get nearer to it. A waypoint before the goal that
/// is unreachable for some time is skipped once the robot is as near to it as possible.
std::optional<motion::Route::Leg> Formation::nextLeg(const Pose2& map_from_base) {
  lead_.passed(map_from_base.translation());
  const auto waypoint = lead_.waypoint();
  if (!waypoint) return std::nullopt;
  const motion::Route::Leg leg =
      route_.towards(memory_, map_from_base.translation(), *waypoint, around_.radius_m);
  const bool ends_here = !leg.reaches && leg.left_m <= kReachedM;
  stuck_s_ = ends_here ? stuck_s_ + dt_s_ : 0.0;
  if (!ends_here) return leg;
  if (stuck_s_ >= kStuckS && !lead_.isGoal() && memory_.isInside(memory_.cellOf(*waypoint))) {
    lead_.skipTo(lead_.next() + 1);
    stuck_s_ = 0.0;
  }
  return std::nullopt;
}

/// Remaining path of the formation, from the place of its leader.
double Formation::remainingDistance(TimeNs now_ns) const {
  const auto leader = fleet_.now(leader_failover_.leader(), now_ns);
  return leader ? lead_.remainingDistance(leader->translation()) : std::numeric_limits<double>::infinity();
}

void Formation::follow(const Objects& objects, Output& output) {
  const motion::FormationCommand& command = options_.command;
  const motion::Slot slot = motion::slotOf(command.shape, rank_, command.distance_m, command.angle_rad);
  std::optional<motion::Followed> leader = followed(objects, slot);
  if (!leader) {
    drive(Eigen::Vector2d::Zero(), 0.0, options_.limits.max_turn_radps, output);
    return;
  }
  leader->remaining_m = remainingDistance(objects.acquired_ns);
  output.state.narrowing = narrowing_.update(slot, rank_, *leader, trail_, around_, dt_s_);
  const motion::Place place = narrowing_.place(slot, rank_, *leader, trail_, follow_);
  const motion::FollowLaw::Result law = follow_.wanted(slot, *leader, place);
  output.state.target_m = law.place_m;
  output.state.distance_error_m = law.distance_error_m;
  output.state.angle_error_rad = law.angle_error_rad;
  const bool standing = std::abs(leader->twist.forward_mps) < options_.follow.stands_mps;
  const bool enough = standing && nearEnough(law.place_m);
  const double feed_radps = (1.0 - narrowing_.narrowing()) * leader->twist.turn_radps;
  const std::optional<Eigen::Vector2d> via_m = detour(law.place_m, objects.acquired_ns);
  if (enough) {
    drive(Eigen::Vector2d::Zero(), feed_radps, options_.limits.max_turn_radps, output);
  } else if (via_m) {
    const double speed_mps = std::max(law.velocity_mps.norm(), options_.follow.closing_max_mps);
    drive(speed_mps * via_m->normalized(), 0.0, options_.limits.max_turn_radps, output, via_m->norm());
  } else {
    // Obstacles beyond a moving place will soon be in the way.
    const double way_m = standing ? law.place_m.norm() : std::numeric_limits<double>::infinity();
    drive(law.velocity_mps, feed_radps, options_.limits.max_turn_radps, output, way_m);
  }
  output.state.avoiding |= !enough && via_m;
  output.state.arrived = standing && commanded_.forward_mps == 0.0 && commanded_.turn_radps == 0.0;
}

/// Intermediate target (base_link) if remembered obstacles block the straight line to a place.
std::optional<Eigen::Vector2d> Formation::detour(const Eigen::Vector2d& place_m, TimeNs now_ns) {
  const auto own = fleet_.now(robot_, now_ns);
  if (!own) return std::nullopt;
  const motion::Route::Leg leg =
      route_.towards(memory_, own->translation(), *own * place_m, around_.radius_m);
  if (leg.straight || !leg.reaches) return std::nullopt;
  return own->inverse() * leg.via_m;
}

/// Whether a nearby place is reached, or an obstacle blocks the way to it.
bool Formation::nearEnough(const Eigen::Vector2d& place_m) const {
  const double way_m = place_m.norm();
  if (way_m > options_.follow.patient_m || way_m < options_.follow.near_m)
    return way_m < options_.follow.near_m;
  const motion::Avoidance::Options& avoidance = options_.avoidance;
  return avoidance_.freeDistance(around_, place_m / way_m, options_.follow.closing_max_mps,
                                 avoidance.margin_m, way_m) < way_m;
}

void Formation::drive(const Eigen::Vector2d& wanted_mps, double feed_radps, double max_turn_radps,
                      Output& output, double way_m) {
  const motion::Avoidance::Result free = avoidance_.steer(around_, wanted_mps, turned_rad_, way_m);
  output.state.avoiding = free.turned;
  const double before_mps = commanded_.forward_mps;
  commanded_ = motion::twistTowards(free.velocity_mps, free.turned ? 0.0 : feed_radps, commanded_, dt_s_,
                                    max_turn_radps, options_.limits);
  commanded_.forward_mps = avoidance_.brakableSpeed(around_, commanded_.forward_mps, before_mps, dt_s_);
}

}  // namespace omnifleet::formation
