#include "tracking/peers.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::tracking {
namespace {

double seconds(TimeNs later, TimeNs earlier) {
  return static_cast<double>(later - earlier) * 1e-9;
}

bool usable(const PoseEstimate& pose) {
  return pose.valid && pose.frame.empty() && pose.map_from_base.isFinite() && pose.covariance.allFinite();
}

}  // namespace

PeerOptions PeerOptions::read(const options::Section& section) {
  PeerOptions o;
  section.read("max_age_s", o.max_age_s, {0.05, 60.0});
  section.read("max_sigma_m", o.max_sigma_m, {0.01, 10.0});
  section.read("speed_sigma_mps", o.speed_sigma_mps, {0.0, 5.0});
  section.finish();
  return o;
}

Peers::Peers(const PeerOptions& options, const std::string& own,
             const std::map<std::string, RobotBody>& bodies)
    : options_(options), own_(own) {
  for (const auto& [name, body] : bodies) {
    if (name == own) continue;
    Peer peer{name, BodyModel(body)};
    peers_.push_back(peer);
  }
}

void Peers::setInitialPoses(const std::vector<PoseEstimate>& initial_poses) {
  for (const PoseEstimate& initial : initial_poses)
    if (usable(initial)) last_[initial.robot] = {initial, Pose2{}, true, true};
}

void Peers::forgetAssumed() {
  for (auto& [robot, last] : last_)
    if (last.assumed) last = Last{};
}

void Peers::remember(const PoseEstimate& pose) {
  if (!usable(pose)) return;
  Last& last = last_[pose.robot];
  const double dt = seconds(pose.acquired_ns, last.pose.acquired_ns);
  if (last.any && dt <= 0.0) return;
  if (last.any && dt < 1.0) {
    constexpr double kNew =
        0.6;  // smoothing: estimates jump at corrections, a single difference is no velocity
    const Pose2 step = last.pose.map_from_base.inverse() * pose.map_from_base;
    last.twist.x_m += kNew * (step.x_m / dt - last.twist.x_m);
    last.twist.y_m += kNew * (step.y_m / dt - last.twist.y_m);
    last.twist.theta_rad += kNew * (step.theta_rad / dt - last.twist.theta_rad);
  } else {
    last.twist = Pose2{};
  }
  last.pose = pose;
  last.any = true;
}

/// Extrapolates the last pose with its velocity, for robots without wheel odometry. The covariance includes a
/// change of velocity.
PoseEstimate Peers::extrapolated(const Last& last, TimeNs now_ns) const {
  constexpr double kTurnSigma_radps = 0.5;
  const double dt = seconds(now_ns, last.pose.acquired_ns);
  PoseEstimate now = last.pose;
  now.acquired_ns = now_ns;
  now.map_from_base =
      last.pose.map_from_base * Pose2{last.twist.x_m * dt, last.twist.y_m * dt, last.twist.theta_rad * dt};
  now.covariance.diagonal().head<2>().array() += std::pow(options_.speed_sigma_mps * dt, 2);
  now.covariance(2, 2) += std::pow(kTurnSigma_radps * dt, 2);
  return now;
}

void Peers::place(Peer& peer, const Last& last, const PoseEstimate& own, const Pose2& odom_from_base_then,
                  TimeNs now_ns) {
  const double dt = seconds(now_ns, last.pose.acquired_ns);
  const Pose2 odom_from_map = odom_from_base_then * own.map_from_base.inverse();
  const Pose2 moved{last.twist.x_m * dt, last.twist.y_m * dt, last.twist.theta_rad * dt};
  const Pose2 odom_from_peer = odom_from_map * last.pose.map_from_base * moved;
  peer.centre_m = odom_from_peer * peer.body.offset();
  peer.heading_rad = odom_from_peer.theta_rad;
  peer.velocity_mps = odom_from_peer.rotation() * last.twist.translation();

  const Eigen::Vector2d arm = peer.centre_m - odom_from_base_then.translation();
  const Eigen::Vector2d across(-arm.y(), arm.x());
  const Eigen::Matrix2d own_axes = odom_from_base_then.rotation(), peer_axes = odom_from_peer.rotation();
  peer.covariance = own_axes * own.covariance.topLeftCorner<2, 2>() * own_axes.transpose() +
                    own.covariance(2, 2) * across * across.transpose() +
                    peer_axes * last.pose.covariance.topLeftCorner<2, 2>() * peer_axes.transpose();
  peer.covariance.diagonal().array() += std::pow(options_.speed_sigma_mps * dt, 2);
  peer.known = peer.covariance.trace() < 2.0 * options_.max_sigma_m * options_.max_sigma_m;
}

const PoseEstimate* Peers::own() const {
  const auto own = last_.find(own_);
  return own != last_.end() && own->second.any && !own->second.assumed ? &own->second.pose : nullptr;
}

std::vector<Peer>& Peers::predict(const std::vector<PoseEstimate>& poses, const OwnMotion& own_motion) {
  if (!poses.empty()) forgetAssumed();
  for (const PoseEstimate& pose : poses) remember(pose);
  for (Peer& peer : peers_) peer.known = peer.may_be_there = false;
  const auto own = last_.find(own_);
  if (own == last_.end() || !own->second.any) return peers_;
  const auto fresh = [&](const Last& last) {
    const double age = seconds(own_motion.now(), last.pose.acquired_ns);
    return last.any && std::abs(age) <= options_.max_age_s;
  };
  if (!fresh(own->second)) return peers_;
  PoseEstimate here = own->second.pose;
  auto odom_from_base = own_motion.odomFromBaseAt(here.acquired_ns);
  if (!odom_from_base) {
    here = extrapolated(own->second, own_motion.now());
    odom_from_base = own_motion.odomFromBase();
  }
  for (Peer& peer : peers_) {
    const auto last = last_.find(peer.robot);
    if (last == last_.end() || !fresh(last->second)) continue;
    place(peer, last->second, here, *odom_from_base, own_motion.now());
  }
  return peers_;
}

}  // namespace omnifleet::tracking
