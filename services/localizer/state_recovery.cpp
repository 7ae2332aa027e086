#include "localizer/state_recovery.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace omnifleet::localizer {
namespace {

// A map is more accurate than this, and keyframe poses are rounded to 0.1 mm. The covariances of the previous
// incarnation are lost.
constexpr double kMapSigma_m = 0.02, kMapSigma_rad = 0.01;

}  // namespace

StateRecovery::StateRecovery(std::vector<estimation::RobotSetup> robots,
                             const estimation::EstimatorOptions& options, std::uint32_t kept,
                             std::set<std::string> mapping)
    : options_(options), kept_(kept), mapping_(std::move(mapping)) {
  for (estimation::RobotSetup& robot : robots) {
    const std::string name = robot.name;
    robots_.emplace(name, std::move(robot));
  }
}

void StateRecovery::receive(const occupancy::KeyframePose& pose) {
  if (!pose.valid || robots_.count(pose.robot) == 0) return;
  const auto order = [](const occupancy::KeyframePose& p) {
    return std::make_tuple(p.acquired_ns, p.term, p.revision);
  };
  const auto [at, fresh] = latest_.try_emplace(pose.robot, pose);
  if (!fresh && order(at->second) < order(pose)) at->second = pose;
}

void StateRecovery::receive(const Objects& frame) {
  std::uint32_t& newest = newest_[frame.robot];
  newest = std::max(newest, frame.sequence);
  const auto [oldest, fresh] = oldest_ns_.try_emplace(frame.robot, frame.acquired_ns);
  if (!fresh) oldest->second = std::min(oldest->second, frame.acquired_ns);
}

/// Whether a pose of the robot is known from which its frames continue.
bool StateRecovery::continues(const std::string& robot) const {
  const auto pose = latest_.find(robot);
  const auto frame = oldest_ns_.find(robot);
  if (pose == latest_.end() || (frame == oldest_ns_.end() && mapping_.count(robot) > 0)) return false;
  return frame == oldest_ns_.end() || pose->second.acquired_ns >= frame->second;
}

bool StateRecovery::isComplete() const {
  return std::all_of(robots_.begin(), robots_.end(),
                     [&](const auto& robot) { return continues(robot.first); });
}

bool StateRecovery::isCompleteForHeard() const {
  return !oldest_ns_.empty() && std::all_of(oldest_ns_.begin(), oldest_ns_.end(),
                                            [&](const auto& robot) { return continues(robot.first); });
}

std::vector<estimation::RobotSetup> StateRecovery::setups() const {
  std::vector<estimation::RobotSetup> all;
  for (const auto& [name, robot] : robots_) {
    estimation::RobotSetup setup = robot;
    setup.initial_pose.reset();
    setup.founds_map = false;
    if (const auto at = latest_.find(name); at != latest_.end())
      setup.camera_error = occupancy::cameraErrorOf(at->second.camera_error);
    all.push_back(std::move(setup));
  }
  return all;
}

std::map<std::string, Pose2> StateRecovery::ownFrames(const std::map<std::string, Pose2>& may) const {
  std::map<std::string, Pose2> still;
  for (const auto& [robot, first] : may) {
    const auto at = latest_.find(robot);
    if (at == latest_.end())
      still.emplace(robot, first);
    else if (!at->second.frame.empty())
      still.emplace(robot, at->second.mapFromBase());
  }
  return still;
}

std::set<std::string> StateRecovery::inMap() const {
  std::set<std::string> robots;
  for (const auto& [robot, pose] : latest_)
    if (pose.frame.empty()) robots.insert(robot);
  return robots;
}

bool StateRecovery::isPast(const std::string& robot, TimeNs time) const {
  const auto at = latest_.find(robot);
  return at != latest_.end() && time < at->second.acquired_ns;
}

std::optional<Measurement> StateRecovery::recoverPose(const Objects& frame) {
  const auto robot = robots_.find(frame.robot);
  if (robot == robots_.end() || isPast(frame.robot, frame.acquired_ns) ||
      !recovered_.insert(frame.robot).second)
    return std::nullopt;
  receive(frame);
  Measurement recovered_pose;
  recovered_pose.source = "map/keyframe_pose";
  recovered_pose.kind = MeasurementKind::kAbsolutePose;
  recovered_pose.to = frame.robot;
  recovered_pose.acquired_ns = frame.acquired_ns;
  double sigma_m = options_.initial_sigma_m, sigma_rad = options_.initial_sigma_rad;
  const auto at = latest_.find(frame.robot);
  if (at != latest_.end() && !at->second.frame.empty()) return std::nullopt;  // see ownFrames()
  if (at != latest_.end()) {
    const double gap_s = 1e-9 * static_cast<double>(frame.acquired_ns - at->second.acquired_ns);
    sigma_m = std::hypot(kMapSigma_m, options_.no_wheels_sigma_mps * gap_s);
    sigma_rad = std::hypot(kMapSigma_rad, options_.no_wheels_sigma_radps * gap_s);
    recovered_pose.value = at->second.mapFromBase().vector();
  } else if (robot->second.initial_pose && newest_[frame.robot] < kept_) {
    recovered_pose.value = robot->second.initial_pose->vector();
  } else {
    unknown_.push_back(frame.robot);
    return std::nullopt;
  }
  recovered_pose.covariance =
      Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
  return recovered_pose;
}

std::vector<std::string> StateRecovery::takeUnknownRobots() {
  return std::exchange(unknown_, {});
}

}  // namespace omnifleet::localizer
