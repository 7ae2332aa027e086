#include "estimation/path_memory.h"

#include <cmath>
#include <utility>

namespace omnifleet::estimation {
namespace {

bool differs(const Pose2& a, const Pose2& b, double m, double rad) {
  const Pose2 by = a.inverse() * b;
  return by.translation().norm() > m || std::abs(by.theta_rad) > rad;
}

}  // namespace

void PathMemory::add(const PoseEstimate& published) {
  free_.push_back(published);
  ++size_;
}

void PathMemory::add(const PoseEstimate& published, Id keyframe, const Pose2& map_from_keyframe) {
  if (groups_.size() <= keyframe) groups_.resize(keyframe + 1);
  Group& group = groups_[keyframe];
  if (group.frames.empty()) group.map_from_keyframe = map_from_keyframe;
  group.frames.push_back({published, map_from_keyframe.inverse() * published.map_from_base});
  ++size_;
}

void PathMemory::follow(const KeyframeMap& map, double moved_m, double moved_rad,
                        std::vector<PoseEstimate>& revised) {
  for (std::size_t k = 0; k < groups_.size(); ++k) {
    Group& group = groups_[k];
    if (group.frames.empty()) continue;
    const Pose2& now = map.pose(static_cast<Id>(k));
    // A frame is never farther from its keyframe than scans reach: half the bounds at the keyframe suffice.
    if (!differs(group.map_from_keyframe, now, 0.5 * moved_m, 0.5 * moved_rad)) continue;
    group.map_from_keyframe = now;
    for (Frame& frame : group.frames) {
      const Pose2 pose = now * frame.keyframe_from_base;
      if (!differs(frame.published.map_from_base, pose, moved_m, moved_rad)) continue;
      frame.published.map_from_base = pose;
      revised.push_back(frame.published);
    }
  }
}

void PathMemory::append(const PathMemory& other, Id first, const Pose2& map_from_other,
                        const KeyframeMap& map, std::vector<PoseEstimate>& revised) {
  for (PoseEstimate pose : other.free_) {
    pose.map_from_base = map_from_other * pose.map_from_base;
    revised.push_back(pose);
    add(pose);
  }
  for (std::size_t k = 0; k < other.groups_.size(); ++k) {
    const Id keyframe = first + static_cast<Id>(k);
    for (Frame frame : other.groups_[k].frames) {
      frame.published.map_from_base = map.pose(keyframe) * frame.keyframe_from_base;
      revised.push_back(frame.published);
      add(frame.published, keyframe, map.pose(keyframe));
    }
  }
}

std::vector<PoseEstimate> PathMemory::poses() const {
  std::vector<PoseEstimate> all = free_;
  for (const Group& group : groups_)
    for (const Frame& frame : group.frames) all.push_back(frame.published);
  return all;
}

}  // namespace omnifleet::estimation
