#include "global_merger/trajectories.h"

#include <algorithm>
#include <cstddef>
#include <iterator>

namespace omnifleet::global_merger {
namespace {

/// Where a row of this time belongs in rows in order of time. Empty if there is a row of this time.
template <typename Row>
std::optional<std::ptrdiff_t> freePlace(const std::vector<Row>& rows, TimeNs time_ns) {
  const auto after = std::upper_bound(rows.begin(), rows.end(), time_ns,
                                      [](TimeNs time, const Row& row) { return time < row.time_ns; });
  if (after != rows.begin() && std::prev(after)->time_ns == time_ns) return std::nullopt;
  return after - rows.begin();
}

/// A keyframe pose has no more than σ; it is rounded to units of 0.1 mm and 0.1 mrad (variance 1/12).
Eigen::Matrix3d covarianceOf(const occupancy::KeyframePose& pose) {
  constexpr double kUnit = 1.0 / occupancy::kDmmPerMetre, kRounding = 1.0 / 12.0;
  const auto variance = [](double sigma) { return (sigma * sigma + kRounding) * kUnit * kUnit; };
  const double position_m2 = variance(pose.sigma_dmm);
  return Eigen::Vector3d(position_m2, position_m2, variance(pose.sigma_dmrad)).asDiagonal();
}

}  // namespace

void Trajectories::add(const PoseEstimate& pose, const std::string& frame) {
  auto& states = states_[pose.robot];
  if (const auto place = freePlace(states, pose.acquired_ns))
    states.insert(states.begin() + *place, {pose.acquired_ns, pose.state, pose.event, pose.correction_sigmas,
                                            pose.used, pose.rejected});
  if (!pose.valid || !pose.map_from_base.isFinite()) return;
  const auto [found, is_first] = samples_.try_emplace(pose.robot);
  Samples& samples = found->second;
  if (is_first || pose.acquired_ns > samples.latest_ns) {
    samples.latest_ns = pose.acquired_ns;
    samples.latest_frame = pose.frame;
  }
  if (pose.frame != frame) {
    samples.elsewhere.insert(pose.acquired_ns);
    return;
  }
  auto& [path, covariances] = samples.in_map;
  const auto place = freePlace(path, pose.acquired_ns);
  if (!place) return;
  covariances.insert(covariances.begin() + *place, {pose.acquired_ns, pose.covariance, pose.datum});
  path.insert(path.begin() + *place, {pose.acquired_ns, pose.map_from_base});
}

Trajectories::Trajectory Trajectories::whole(const Samples& samples,
                                             const occupancy::ContributionStore::Path* path,
                                             const occupancy::ContributionStore& store) {
  if (path == nullptr || samples.elsewhere.empty()) return samples.in_map;
  const Trajectory& causal = samples.in_map;
  Trajectory all;
  std::size_t next = 0;  // of the causal poses
  const auto takeUntil = [&](TimeNs time_ns) {
    for (; next < causal.poses.size() && causal.poses[next].time_ns <= time_ns; ++next) {
      all.poses.push_back(causal.poses[next]);
      all.covariances.push_back(causal.covariances[next]);
    }
  };
  for (const TimeNs time_ns : samples.elsewhere) {
    takeUntil(time_ns);
    if (!all.poses.empty() && all.poses.back().time_ns == time_ns) continue;
    const auto keyframe = path->find(time_ns);
    const auto* pose = keyframe == path->end() ? nullptr : store.poseOf(keyframe->second);
    if (pose == nullptr) continue;
    std::uint32_t datum = 0;
    if (!causal.covariances.empty())
      datum = causal.covariances[std::min(next, causal.covariances.size() - 1)].datum;
    all.poses.push_back({time_ns, pose->mapFromBase()});
    all.covariances.push_back({time_ns, covarianceOf(*pose), datum});
  }
  takeUntil(INT64_MAX);
  return all;
}

std::map<std::string, Trajectories::Trajectory> Trajectories::of(
    const occupancy::ContributionStore& store) const {
  std::map<std::string, Trajectory> all;
  for (const auto& [robot, samples] : samples_) {
    Trajectory trajectory = whole(samples, store.find(robot), store);
    if (!trajectory.poses.empty()) all.emplace(robot, std::move(trajectory));
  }
  return all;
}

std::optional<std::pair<TimeNs, std::string>> Trajectories::latest(const std::string& robot) const {
  const auto found = samples_.find(robot);
  if (found == samples_.end()) return std::nullopt;
  return std::pair{found->second.latest_ns, found->second.latest_frame};
}

}  // namespace omnifleet::global_merger
