#include "occupancy/contribution_store.h"

#include <tuple>

namespace omnifleet::occupancy {

bool ContributionStore::add(const Contribution& contribution) {
  auto& keyframe = robots_[contribution.robot][contribution.acquired_ns];
  const std::string bytes = canonicalBytes(contribution);
  if (keyframe.contribution && bytes <= canonicalBytes(*keyframe.contribution)) return false;
  if (!keyframe.contribution) ++contributions_;
  keyframe.contribution = std::make_shared<const Contribution>(contribution);
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
  return true;
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

std::vector<Held> ContributionStore::held() const {
  std::vector<Held> all;
  for (const auto& [robot, path] : robots_) {
    Held held;
    held.robot = robot;
    held.first_ns = path.begin()->first;
    held.last_ns = path.rbegin()->first;
    for (const auto& [time_ns, keyframe] : path) {
      held.contributions += keyframe.contribution ? 1U : 0U;
      held.keyframe_poses += keyframe.pose ? 1U : 0U;
      held.digest += keyframe.contribution_digest + keyframe.pose_digest;
    }
    all.push_back(std::move(held));
  }
  return all;
}

std::vector<Contribution> ContributionStore::contributionsBetween(const std::string& robot, TimeNs first_ns,
                                                                  TimeNs last_ns) const {
  std::vector<Contribution> found;
  const Path* path = find(robot);
  if (path == nullptr) return found;
  for (auto it = path->lower_bound(first_ns); it != path->end() && it->first <= last_ns; ++it) {
    if (it->second.contribution) found.push_back(*it->second.contribution);
  }
  return found;
}

std::vector<KeyframePose> ContributionStore::posesBetween(const std::string& robot, TimeNs first_ns,
                                                          TimeNs last_ns) const {
  std::vector<KeyframePose> found;
  const Path* path = find(robot);
  if (path == nullptr) return found;
  for (auto it = path->lower_bound(first_ns); it != path->end() && it->first <= last_ns; ++it) {
    if (it->second.pose) found.push_back(*it->second.pose);
  }
  return found;
}

}  // namespace omnifleet::occupancy
