#include "localizer/succession.h"

#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

namespace omnifleet::localizer {
namespace {

// A map is better than this, and its keyframes are told to 0.1 mm; what the predecessor thought of their
// errors went with it.
constexpr double kMapped_m = 0.02, kMapped_rad = 0.01;

}  // namespace

Succession::Succession(std::vector<estimation::RobotSetup> robots,
                       const estimation::EstimatorOptions& options, std::uint32_t kept,
                       std::set<std::string> mapping)
    : options_(options), kept_(kept), mapping_(std::move(mapping)) {
  for (estimation::RobotSetup& robot : robots) {
    const std::string name = robot.name;
    robots_.emplace(name, std::move(robot));
  }
}

void Succession::hear(const occupancy::KeyframePose& pose) {
  if (!pose.valid || robots_.count(pose.robot) == 0) return;
  const auto order = [](const occupancy::KeyframePose& p) {
    return std::make_tuple(p.acquired_ns, p.term, p.revision);
  };
  const auto [at, fresh] = latest_.try_emplace(pose.robot, pose);
  if (!fresh && order(at->second) < order(pose)) at->second = pose;
}

void Succession::hear(const Objects& frame) {
  std::uint32_t& newest = newest_[frame.robot];
  newest = std::max(newest, frame.sequence);
  const auto [oldest, fresh] = oldest_ns_.try_emplace(frame.robot, frame.acquired_ns);
  if (!fresh) oldest->second = std::min(oldest->second, frame.acquired_ns);
}

bool Succession::heardOfAll() const {
  return std::all_of(robots_.begin(), robots_.end(), [&](const auto& robot) {
    const auto pose = latest_.find(robot.first);
    const auto frame = oldest_ns_.find(robot.first);
    if (pose == latest_.end() || (frame == oldest_ns_.end() && mapping_.count(robot.first) > 0)) return false;
    return frame == oldest_ns_.end() || pose->second.acquired_ns >= frame->second;
  });
}

std::vector<estimation::RobotSetup> Succession::setups() const {
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

bool Succession::isPast(const std::string& robot, TimeNs time) const {
  const auto at = latest_.find(robot);
  return at != latest_.end() && time < at->second.acquired_ns;
}

std::optional<Measurement> Succession::place(const Objects& frame) {
  const auto robot = robots_.find(frame.robot);
  if (robot == robots_.end() || isPast(frame.robot, frame.acquired_ns) || !placed_.insert(frame.robot).second)
    return std::nullopt;
  hear(frame);
  Measurement placing;
  placing.source = "map/keyframe_pose";
  placing.kind = MeasurementKind::kAbsolutePose;
  placing.to = frame.robot;
  placing.acquired_ns = frame.acquired_ns;
  double sigma_m = options_.initial_sigma_m, sigma_rad = options_.initial_sigma_rad;
  const auto at = latest_.find(frame.robot);
  if (at != latest_.end()) {
    const double gap_s = 1e-9 * static_cast<double>(frame.acquired_ns - at->second.acquired_ns);
    sigma_m = std::hypot(kMapped_m, options_.no_wheels_sigma_mps * gap_s);
    sigma_rad = std::hypot(kMapped_rad, options_.no_wheels_sigma_radps * gap_s);
    placing.value = at->second.mapFromBase().vector();
  } else if (robot->second.initial_pose && newest_[frame.robot] < kept_) {
    placing.value = robot->second.initial_pose->vector();
  } else {
    unknown_.push_back(frame.robot);
    return std::nullopt;
  }
  placing.covariance =
      Eigen::Vector3d(sigma_m * sigma_m, sigma_m * sigma_m, sigma_rad * sigma_rad).asDiagonal();
  return placing;
}

std::vector<std::string> Succession::takeUnknown() {
  return std::exchange(unknown_, {});
}

}  // namespace omnifleet::localizer
