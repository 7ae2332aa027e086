#include "occupancy/contribution_store.h"

#include <algorithm>
#include <tuple>

#include "occupancy/camera_correction.h"

namespace omnifleet::occupancy {

const KeyframePose* ContributionStore::poseOf(const Keyframe& keyframe) const {
  constexpr std::int32_t kMaxDmm = 15000000;  // 1500 m
  const auto& pose = keyframe.pose;
  if (!pose || !pose->valid || pose->frame != frame_) return nullptr;
  const auto isWithin = [](std::int32_t dmm) { return -kMaxDmm <= dmm && dmm <= kMaxDmm; };
  return isWithin(pose->position.x_dmm) && isWithin(pose->position.y_dmm) ? &*pose : nullptr;
}

std::shared_ptr<const Contribution> ContributionStore::withoutError(
    const std::shared_ptr<const Contribution>& seen) const {
  const CameraErrorPpm error = cameraError(seen->robot);
  if (error == CameraErrorPpm{}) return seen;
  const auto lens = lenses_.find(seen->robot);
  return std::make_shared<const Contribution>(
      withoutCameraError(*seen, error, lens == lenses_.end() ? lens::Spread() : lens->second));
}

bool ContributionStore::add(const Contribution& contribution) {
  auto& keyframe = robots_[contribution.robot][contribution.acquired_ns];
  const std::string bytes = canonicalBytes(contribution);
  if (keyframe.contribution && bytes <= canonicalBytes(*keyframe.contribution)) return false;
  if (!keyframe.contribution) ++contributions_;
  keyframe.contribution = std::make_shared<const Contribution>(contribution);
  keyframe.corrected = withoutError(keyframe.contribution);
  keyframe.contribution_digest = digest(bytes);
  return true;
}

bool ContributionStore::add(const KeyframePose& pose) {
  auto& held = robots_[pose.robot][pose.acquired_ns];
  const std::string bytes = canonicalBytes(pose);
  if (held.pose) {
    const auto rank = [](const KeyframePose& p) { return std::make_tuple(p.term, p.revision); };
    if (rank(pose) < rank(*held.pose)) return false;
    if (rank(pose) == rank(*held.pose) && bytes <= canonicalBytes(*held.pose)) return false;
  } else {
    ++poses_;
  }
  held.pose = pose;
  held.pose_digest = digest(bytes);
  noteCameraError(pose.robot);
  return true;
}

CameraErrorPpm ContributionStore::cameraError(const std::string& robot) const {
  const auto found = errors_.find(robot);
  return found == errors_.end() ? CameraErrorPpm{} : found->second;
}

void ContributionStore::noteCameraError(const std::string& robot) {
  const Path& path = robots_.at(robot);
  const auto latest = std::find_if(path.rbegin(), path.rend(),
                                   [this](const auto& entry) { return poseOf(entry.second) != nullptr; });
  const CameraErrorPpm error = latest == path.rend() ? CameraErrorPpm{} : latest->second.pose->camera_error;
  if (error == cameraError(robot)) return;
  errors_[robot] = error;
  uncorrected_from_[robot] = path.begin()->first;
}

std::vector<std::pair<std::string, TimeNs>> ContributionStore::correctNext(std::size_t at_most) {
  std::vector<std::pair<std::string, TimeNs>> done;
  while (!uncorrected_from_.empty() && done.size() < at_most) {
    const std::string robot = uncorrected_from_.begin()->first;
    Path& path = robots_.at(robot);
    auto at = path.lower_bound(uncorrected_from_.begin()->second);
    for (; at != path.end() && done.size() < at_most; ++at) {
      if (!at->second.contribution) continue;
      at->second.corrected = withoutError(at->second.contribution);
      done.emplace_back(robot, at->first);
    }
    if (at == path.end()) {
      uncorrected_from_.erase(robot);
    } else {
      uncorrected_from_[robot] = at->first;
    }
  }
  return done;
}

const ContributionStore::Path* ContributionStore::find(const std::string& robot) const {
  const auto found = robots_.find(robot);
  return found == robots_.end() ? nullptr : &found->second;
}

const ContributionStore::Keyframe* ContributionStore::find(const std::string& robot,
                                                           TimeNs acquired_ns) const {
  const Path* path = find(robot);
  if (path == nullptr) return nullptr;
  const auto found = path->find(acquired_ns);
  return found == path->end() ? nullptr : &found->second;
}

}  // namespace omnifleet::occupancy
