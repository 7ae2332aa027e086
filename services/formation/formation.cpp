#include "formation/formation.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace omnifleet::formation {
namespace {

constexpr double kSecondsPerNs = 1e-9;
constexpr double kFirstStepS = 0.1;      // until two frames tell the period
constexpr double kLongestStepS = 0.5;    // a gap in the frames lets nobody jump
constexpr double kHeadingMps = 0.08;     // a track this fast shows its heading
constexpr double kSpeedSmoothing = 0.5;  // share of the newest published step in the speed

double seconds(TimeNs from_ns, TimeNs to_ns) {
  return static_cast<double>(to_ns - from_ns) * kSecondsPerNs;
}

double reach(const RobotBody& body) {
  double reach_m = body.radius_m;
  for (const Eigen::Vector2d& vertex : body.footprint_m) reach_m = std::max(reach_m, vertex.norm());
  return reach_m;
}

Pose2 advanced(const Pose2& pose, const motion::Twist& twist, double dt_s) {
  return pose * motion::rolled(twist.forward_mps * dt_s - 0.5 * twist.turn_radps * dt_s,
                               twist.forward_mps * dt_s + 0.5 * twist.turn_radps * dt_s, 1.0,
                               motion::Integration::kArc);
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
  options.limits = motion::DriveLimits::read(section.child("limits"));
  options.follow = motion::FollowLaw::Options::read(section.child("follow"));
  options.lead = motion::LeadLaw::Options::read(section.child("lead"));
  options.avoidance = motion::Avoidance::Options::read(section.child("avoidance"));
  section.read("gate_m", options.gate_m, {0.01, 5.0});
  section.read("own_points_m", options.own_points_m, {0.0, 2.0});
  section.read("pose_age_limit_s", options.pose_age_limit_s, options::kPositive);
  section.read("lost_limit_s", options.lost_limit_s, options::kPositive);
  section.finish();
  return options;
}

Formation::Formation(const std::string& robot, const std::map<std::string, RobotBody>& bodies,
                     const Options& options)
    : robot_(robot),
      leader_(options.leader.empty() && !bodies.empty() ? bodies.begin()->first : options.leader),
      bodies_(bodies),
      options_(options),
      follow_(options.follow),
      lead_(options.lead),
      avoidance_(options.avoidance) {
  if (!bodies.count(robot)) throw std::runtime_error("formation: robot " + robot + " is not in the fleet");
  if (!bodies.count(leader_))
    throw std::runtime_error("formation: leader " + leader_ + " is not in the fleet");
  ranks_.push_back(leader_);
  for (const auto& [name, body] : bodies_) {
    if (name != leader_) ranks_.push_back(name);
  }
  rank_ = static_cast<std::size_t>(std::find(ranks_.begin(), ranks_.end(), robot_) - ranks_.begin());
  lead_.follow(options.command.waypoints_m);
}

bool Formation::command(const motion::FormationCommand& command) {
  const motion::FormationCommand& now = options_.command;
  if (!now.fleet.empty() && command.fleet != now.fleet) return false;
  if (command.acquired_ns < now.acquired_ns) return false;
  options_.command = command;
  lead_.follow(command.waypoints_m);
  return true;
}

Formation::Output Formation::process(const Objects& objects, const std::vector<PoseEstimate>& poses) {
  Output output;
  output.command = {robot_, objects.acquired_ns, objects.sequence, {}};
  output.state.robot = robot_;
  output.state.acquired_ns = objects.acquired_ns;
  output.state.sequence = objects.sequence;
  output.state.leader = leader_;
  output.state.role = rank_ == 0 ? motion::FormationRole::kLeader : motion::FormationRole::kFollower;
  remember(objects);
  learn(poses);
  if (objects.state != FrameState::kOk || options_.command.waypoints_m.empty()) {
    commanded_ = {};
    if (options_.command.waypoints_m.empty()) output.state.role = motion::FormationRole::kIdle;
    return output;
  }
  lookAround(objects);
  if (rank_ == 0) {
    lead(objects, output);
  } else {
    follow(objects, output);
  }
  const double separation_m = bodies_.at(robot_).wheel_separation_m;
  output.command.speeds = motion::wheelsFromTwist(commanded_, separation_m);
  return output;
}

void Formation::remember(const Objects& objects) {
  const TimeNs now_ns = objects.acquired_ns;
  dt_s_ = frame_ns_ > 0 ? std::clamp(seconds(frame_ns_, now_ns), 0.0, kLongestStepS) : kFirstStepS;
  frame_ns_ = now_ns;
  // Where the wheels say nothing, the robot did as it was told.
  Pose2 step = advanced(Pose2{}, commanded_, dt_s_);
  TimeNs since_ns = now_ns - static_cast<TimeNs>(std::llround(dt_s_ / kSecondsPerNs));
  if (objects.motion.valid) {
    step = objects.motion.previous_from_current;
    since_ns = objects.motion.since_ns;
  }
  moved_.push_back({since_ns, now_ns, step});
  while (seconds(moved_.front().to_ns, now_ns) > options_.pose_age_limit_s) moved_.pop_front();
  turned_rad_ = step.theta_rad;
  if (last_followed_) {
    // Into the new base_link, and on by its own speed.
    const Pose2 old{last_followed_->position_m.x(), last_followed_->position_m.y(),
                    last_followed_->heading_rad};
    const Pose2 now = step.inverse() * advanced(old, last_followed_->twist, dt_s_);
    last_followed_->position_m = now.translation();
    last_followed_->heading_rad = now.theta_rad;
  }
}

void Formation::learn(const std::vector<PoseEstimate>& poses) {
  for (const PoseEstimate& pose : poses) {
    if (!pose.valid || !pose.map_from_base.isFinite()) continue;
    const auto [entry, is_new] = known_.try_emplace(pose.robot);
    Known& known = entry->second;
    const double dt_s = seconds(known.acquired_ns, pose.acquired_ns);
    if (!is_new && dt_s <= 0.0) continue;
    if (!is_new && dt_s < options_.pose_age_limit_s) {
      const Pose2 step = known.map_from_base.inverse() * pose.map_from_base;
      const double share = kSpeedSmoothing;
      known.twist.forward_mps += share * (step.x_m / dt_s - known.twist.forward_mps);
      known.twist.turn_radps += share * (step.theta_rad / dt_s - known.twist.turn_radps);
    } else {
      known.twist = {};
    }
    known.map_from_base = pose.map_from_base;
    known.acquired_ns = pose.acquired_ns;
    known.sightings = pose.sightings;
  }
}

std::optional<Pose2> Formation::publishedNow(const std::string& robot, TimeNs now_ns) const {
  const auto found = known_.find(robot);
  if (found == known_.end()) return std::nullopt;
  const Known& known = found->second;
  const double age_s = seconds(known.acquired_ns, now_ns);
  if (age_s < 0.0 || age_s > options_.pose_age_limit_s) return std::nullopt;
  if (robot != robot_) return advanced(known.map_from_base, known.twist, age_s);
  Pose2 map_from_base = known.map_from_base;
  for (const Moved& moved : moved_) {
    if (moved.from_ns >= known.acquired_ns) map_from_base = map_from_base * moved.from_from_to;
  }
  return map_from_base;
}

void Formation::lookAround(const Objects& objects) {
  const double own_m = reach(bodies_.at(robot_));
  double widest_m = 0.0;
  for (const auto& [name, body] : bodies_) widest_m = std::max(widest_m, reach(body));
  motion::surroundingsFrom(objects, own_m, widest_m, around_);
  const auto own = publishedNow(robot_, objects.acquired_ns);
  if (!own) return;
  for (const auto& [name, body] : bodies_) {
    if (name == robot_) continue;
    const auto other = publishedNow(name, objects.acquired_ns);
    if (!other) continue;
    const Pose2 base_from_other = own->inverse() * *other;
    const Eigen::Vector2d place_m = base_from_other.translation();
    const double reach_m = reach(body);
    auto& robots = around_.robots;
    const bool seen = std::any_of(robots.begin(), robots.end(), [&](const motion::Neighbour& neighbour) {
      return (neighbour.position_m - place_m).norm() < options_.gate_m;
    });
    const Eigen::Vector2d velocity_mps =
        base_from_other.rotation().col(0) * known_.at(name).twist.forward_mps;
    if (!seen) robots.push_back({place_m, velocity_mps, reach_m});
    // What was taken for something unknown at a robot's published place is that robot.
    auto& points = around_.points_m;
    points.erase(std::remove_if(points.begin(), points.end(),
                                [&](const Eigen::Vector2d& point) {
                                  return (point - place_m).norm() < reach_m + options_.own_points_m;
                                }),
                 points.end());
  }
}

const Track* Formation::sighted(const Objects& objects, const Eigen::Vector2d& expected_m) const {
  const auto own = known_.find(robot_);
  if (own != known_.end()) {
    for (const Sighting& sighting : own->second.sightings) {
      if (sighting.robot != followed_name_) continue;
      for (const Track& track : objects.tracks) {
        const bool near = (track.position_m - expected_m).norm() < 2.0 * options_.gate_m;
        if (track.id == sighting.track_id && track.visible && near) return &track;
      }
    }
  }
  const Track* best = nullptr;
  double least_m = options_.gate_m;
  for (const Track& track : objects.tracks) {
    const double off_m = (track.position_m - expected_m).norm();
    if (track.kind != ObjectKind::kRobot || !track.visible || off_m >= least_m) continue;
    best = &track;
    least_m = off_m;
  }
  return best;
}

std::optional<motion::Followed> Formation::followed(const Objects& objects) {
  const motion::FormationCommand& orders = options_.command;
  const motion::Slot slot = motion::slotOf(orders.shape, rank_, orders.distance_m, orders.angle_rad);
  followed_name_ = ranks_[slot.followed];
  const auto own = publishedNow(robot_, objects.acquired_ns);
  const auto other = publishedNow(followed_name_, objects.acquired_ns);
  std::optional<motion::Followed> result;
  Eigen::Vector2d expected_m =
      slot.distance_m * Eigen::Vector2d(std::cos(slot.angle_rad), std::sin(slot.angle_rad));
  if (own && other) {
    const Pose2 base_from_followed = own->inverse() * *other;
    result = motion::Followed{base_from_followed.translation(), base_from_followed.theta_rad,
                              known_.at(followed_name_).twist, false};
    expected_m = result->position_m;
  } else if (last_followed_) {
    expected_m = last_followed_->position_m;
  }
  if (const Track* track = sighted(objects, expected_m)) {
    if (!result) {
      // Nobody publishes: the heading is that of its way, or the one known before.
      const double speed_mps = track->velocity_mps.norm();
      const bool moves = speed_mps > kHeadingMps;
      const double known_rad = last_followed_ ? last_followed_->heading_rad : 0.0;
      result = motion::Followed{};
      result->heading_rad = moves ? std::atan2(track->velocity_mps.y(), track->velocity_mps.x()) : known_rad;
      result->twist.forward_mps = speed_mps;
    }
    result->position_m = track->position_m;
    result->seen = true;
  }
  if (result) {
    last_followed_ = result;
    last_followed_ns_ = objects.acquired_ns;
  } else if (last_followed_ && seconds(last_followed_ns_, objects.acquired_ns) <= options_.lost_limit_s) {
    result = last_followed_;
    result->seen = false;
  }
  return result;
}

double Formation::worstFollower(TimeNs now_ns) const {
  const auto own = publishedNow(robot_, now_ns);
  if (!own) return 0.0;
  const std::vector<Eigen::Vector2d> places = motion::placesOf(options_.command, ranks_.size());
  double worst_m = 0.0;
  for (std::size_t rank = 1; rank < ranks_.size(); ++rank) {
    const auto other = publishedNow(ranks_[rank], now_ns);
    if (other) worst_m = std::max(worst_m, (*own * places[rank] - other->translation()).norm());
  }
  return worst_m;
}

void Formation::lead(const Objects& objects, Output& output) {
  const auto own = publishedNow(robot_, objects.acquired_ns);
  if (!own) {
    drive(Eigen::Vector2d::Zero(), 0.0, options_.limits.lead_turn_radps, output);
    return;
  }
  const Eigen::Vector2d wanted_mps =
      lead_.wanted(*own, worstFollower(objects.acquired_ns), options_.limits.cruise_mps);
  if (const auto waypoint = lead_.waypoint()) output.state.target_m = own->inverse() * *waypoint;
  drive(wanted_mps, 0.0, options_.limits.lead_turn_radps, output);
  output.state.arrived = lead_.arrived();
}

void Formation::follow(const Objects& objects, Output& output) {
  const std::optional<motion::Followed> leader = followed(objects);
  if (!leader) {
    drive(Eigen::Vector2d::Zero(), 0.0, options_.limits.max_turn_radps, output);
    return;
  }
  const motion::FormationCommand& orders = options_.command;
  const motion::Slot slot = motion::slotOf(orders.shape, rank_, orders.distance_m, orders.angle_rad);
  const motion::FollowLaw::Result law = follow_.wanted(slot, *leader);
  output.state.target_m = law.place_m;
  output.state.distance_error_m = law.distance_error_m;
  output.state.angle_error_rad = law.angle_error_rad;
  const bool stands = std::abs(leader->twist.forward_mps) < options_.follow.stands_mps;
  const bool enough = stands && nearEnough(law.place_m);
  drive(enough ? Eigen::Vector2d::Zero() : law.velocity_mps, leader->twist.turn_radps,
        options_.limits.max_turn_radps, output);
  output.state.arrived = stands && commanded_.forward_mps == 0.0 && commanded_.turn_radps == 0.0;
}

/// Where something is in the way of a place that is not far off.
bool Formation::nearEnough(const Eigen::Vector2d& place_m) const {
  const double way_m = place_m.norm();
  if (way_m > options_.follow.patient_m || way_m < options_.follow.near_m)
    return way_m < options_.follow.near_m;
  const motion::Avoidance::Options& avoidance = options_.avoidance;
  return avoidance_.freeWay(around_, place_m / way_m, options_.follow.closing_max_mps, avoidance.margin_m,
                            way_m) < way_m;
}

void Formation::drive(const Eigen::Vector2d& wanted_mps, double feed_radps, double max_turn_radps,
                      Output& output) {
  const motion::Avoidance::Result free = avoidance_.steer(around_, wanted_mps, turned_rad_);
  output.state.avoiding = free.turned;
  commanded_ = motion::twistTowards(free.velocity_mps, free.turned ? 0.0 : feed_radps, commanded_, dt_s_,
                                    max_turn_radps, options_.limits);
}

}  // namespace omnifleet::formation
