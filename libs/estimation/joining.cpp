#include "estimation/joining.h"

#include <algorithm>
#include <utility>

#include "estimation/factors.h"
#include "estimation/published_poses.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSameFrame = 1e-6;  // m², rad²: (1 mm)², (1 mrad)²

/// Publishes a frame of the own window in this map. @param map_from_own at that frame
void adoptStep(FleetState& fleet, RobotNode& robot, const RobotNode& theirs, const Step& step,
               const Pose2& map_from_own, const FleetState& own) {
  if (!step.published) return;
  PoseEstimate estimate;
  estimate.robot = theirs.setup.name;
  estimate.acquired_ns = step.time_ns;
  estimate.sequence = step.sequence;
  estimate.valid = true;
  estimate.map_from_base = map_from_own * own.pose(step.pose);
  estimate.covariance = theirs.covariance;
  estimate.camera_error = theirs.camera_aid.published;
  estimate.sightings = step.sightings;
  fleet.revised.push_back(estimate);
  robot.place_aid.path.add(estimate);
}

ScanAid inCommonMap(const ScanAid& own, KeyframeMap::Id first, const KeyframeMap& map) {
  ScanAid aid = own;
  aid.references.clear();
  if (aid.anchor) {
    aid.anchor->keyframe += first;
    aid.anchor->map_from_keyframe = map.pose(aid.anchor->keyframe);
  }
  if (aid.way) aid.way->previous += first;
  return aid;
}

}  // namespace

void joinRobot(FleetState& fleet, RobotNode& robot, const FleetState& own, const Pose2& map_from_own,
               const Eigen::Matrix3d& covariance) {
  const RobotNode& theirs = *own.find(robot.setup.name);
  const Step& newest = theirs.window.back();
  KeyframeMap& map = fleet.keyframes;
  const KeyframeMap::Id first = map.append(own.keyframes, map_from_own, covariance);
  robot.place_aid.path.append(theirs.place_aid.path, first, map_from_own, map, fleet.revised);

  robot.place_aid.memory.append(theirs.place_aid.memory, first, map_from_own, map);
  robot.place_aid.way = theirs.place_aid.way;
  robot.appearance_aid.length = theirs.appearance_aid.length;
  robot.floor = theirs.floor;
  robot.appearance_aid.compass = theirs.appearance_aid.compass;
  robot.covariance = theirs.covariance;

  ScanAid aid = inCommonMap(theirs.scan_aid, first, map);
  const Pose2 own_from_base = own.pose(newest.pose);
  const Pose2 here = aid.anchor ? map.pose(aid.anchor->keyframe) *
                                      own.keyframes.pose(theirs.scan_aid.anchor->keyframe).inverse()
                                : map_from_own;
  for (const Step& step : theirs.window) {
    adoptStep(fleet, robot, theirs, step, here, own);
    if (!step.published) continue;
    auto keyframe = keyframeOf(theirs, step);
    if (keyframe) *keyframe += first;
    rememberPlace(fleet, robot, step, here * own.pose(step.pose), keyframe, false);
  }

  robot.setup.camera_error = robot.camera_aid.published = theirs.camera_aid.published;
  fleet.graph.value(robot.wheel_aid.model) = own.graph.value(theirs.wheel_aid.model);
  Objects frame;
  frame.robot = robot.setup.name;
  frame.acquired_ns = newest.time_ns;
  frame.sequence = newest.sequence;
  fleet.release(robot);
  fleet.place(robot, frame, here * own_from_base);
  // A frame that has just become a keyframe is that keyframe.
  const Eigen::Matrix3d to_keyframe =
      aid.anchor ? Eigen::Matrix3d(aid.anchor->covariance + kSameFrame * Eigen::Matrix3d::Identity())
                 : covariance;
  fleet.graph.addFactor(absolutePoseFactor(here * own_from_base, to_keyframe), {robot.window.back().pose});
  robot.window.back().previous_from_current = newest.previous_from_current;
  robot.window.back().since_ns = newest.since_ns;
  robot.scan_aid = std::move(aid);
  robot.scan_aid.relative_covariance = to_keyframe;
  robot.scan_aid.held = robot.scan_aid.anchor.has_value();
  robot.covariance = ScanSource::inMap(fleet, robot);
  robot.localization_aid.monitor = theirs.localization_aid.monitor;
  robot.last_frame_ns = theirs.last_frame_ns;
  robot.started = true;
  robot.unrefined = false;
}

void adoptPath(FleetState& fleet, RobotNode& robot, const FleetState& own, const Pose2& map_from_own) {
  const RobotNode& theirs = *own.find(robot.setup.name);
  // Its keyframes relate to those of this map by nothing but the robot: they are left behind.
  for (PoseEstimate pose : theirs.place_aid.path.poses()) {
    pose.map_from_base = map_from_own * pose.map_from_base;
    robot.place_aid.path.add(pose);
    fleet.revised.push_back(std::move(pose));
  }
  robot.place_aid.memory.append(theirs.place_aid.memory.withoutKeyframes(), 0, map_from_own, fleet.keyframes);
  for (const Step& step : theirs.window)
    if (step.time_ns < robot.window.front().time_ns) adoptStep(fleet, robot, theirs, step, map_from_own, own);
}

}  // namespace omnifleet::estimation
