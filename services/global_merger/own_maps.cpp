#include "global_merger/own_maps.h"

#include <algorithm>
#include <filesystem>
#include <iterator>
#include <system_error>
#include <utility>

#include "global_merger/save.h"

namespace omnifleet::global_merger {

Merger* OwnMaps::find(const std::string& robot) {
  const auto found = maps_.find(robot);
  return found == maps_.end() ? nullptr : &found->second;
}

bool OwnMaps::mayHaveOne(const std::string& robot, const std::string& frame, bool valid) const {
  return valid && frame == robot && std::find(robots_.begin(), robots_.end(), robot) != robots_.end();
}

/// Begins with what the common map holds of the robot. There were no valid pose samples in this frame before.
void OwnMaps::begin(const std::string& robot, const Merger& common) {
  Merger& own = maps_.emplace(robot, make_(robot)).first->second;
  if (const auto* path = common.map().store().find(robot)) {
    for (const auto& [time_ns, keyframe] : *path) {
      if (keyframe.contribution) own.add(*keyframe.contribution);
      if (keyframe.pose) own.add(*keyframe.pose);
    }
  }
  const auto states = common.localization().find(robot);
  if (states == common.localization().end()) return;
  for (const dataset::StampedLocalization& row : states->second) {
    PoseEstimate without_pose;
    without_pose.robot = robot;
    without_pose.acquired_ns = row.time_ns;
    without_pose.state = row.state;
    without_pose.event = row.event;
    without_pose.correction_sigmas = row.correction_sigmas;
    without_pose.used = row.used;
    without_pose.rejected = row.rejected;
    own.addTrajectory(without_pose);
  }
}

void OwnMaps::add(const occupancy::Contribution& contribution) {
  if (Merger* own = find(contribution.robot)) own->add(contribution);
}

void OwnMaps::add(const occupancy::KeyframePose& pose, const Merger& common) {
  if (Merger* own = find(pose.robot)) {
    own->add(pose);
  } else if (mayHaveOne(pose.robot, pose.frame, pose.valid)) {
    begin(pose.robot, common);
  }
}

void OwnMaps::addTrajectory(const PoseEstimate& pose, const Merger& common) {
  if (find(pose.robot) == nullptr && mayHaveOne(pose.robot, pose.frame, pose.valid))
    begin(pose.robot, common);
  if (Merger* own = find(pose.robot)) own->addTrajectory(pose);
}

bool OwnMaps::correctSome(std::size_t at_most) {
  return std::any_of(maps_.begin(), maps_.end(),
                     [&](auto& entry) { return entry.second.correctSome(at_most); });
}

void OwnMaps::fit(const Meanwhile& meanwhile) {
  for (auto& [robot, own] : maps_) own.outlines(meanwhile);
}

void OwnMaps::finish() {
  for (auto& [robot, own] : maps_) own.finish();
}

std::vector<std::string> OwnMaps::save(const Merger& common, const std::string& folder) const {
  std::vector<std::string> problems;
  for (const std::string& robot : robots_) {
    const auto own = maps_.find(robot);
    const bool is_apart = own != maps_.end() && common.frameOf(robot) == robot;
    const std::string place = folder + "/" + robot;
    std::vector<std::string> failed = is_apart ? own->second.saveAsFitted(place) : removeMap(robot, place);
    std::move(failed.begin(), failed.end(), std::back_inserter(problems));
  }
  std::error_code has_maps;
  std::filesystem::remove(folder, has_maps);
  return problems;
}

}  // namespace omnifleet::global_merger
