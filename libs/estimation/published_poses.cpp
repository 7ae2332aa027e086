#include "estimation/published_poses.h"

#include <algorithm>
#include <cmath>

#include "estimation/messages.h"
#include "estimation/starts.h"

namespace omnifleet::estimation {
namespace {

constexpr double kRevise_m = 0.01, kRevise_rad = 0.01;  // accuracy of a map
constexpr double kWrong = 6.0;        // σ of the prior beyond which an initial pose was wrong
constexpr double kRevisited_m = 0.3;  // of a place from the nearest one of an earlier visit
constexpr std::size_t kApart = 30;    // places between a place and one that it returns to, and between links
constexpr std::size_t kMostHistory = 3000;  // frames: ten minutes at 5 Hz

/// The first frame deviates from the path of the wheels by the jitter of the odometry.
bool isWrong(const FleetState& fleet, const RobotNode& robot) {
  const Start& start = robot.start;
  const Pose2 by = start.given->inverse() * start.moved * *start.given;
  const OdometryQuality& odometry = robot.scan_aid.odometry;
  const double m = std::hypot(fleet.options.initial_sigma_m, odometry.jitterM()),
               rad = std::hypot(fleet.options.initial_sigma_rad, odometry.jitterRad());
  return std::hypot(by.translation().norm() / m, by.theta_rad / rad) > kWrong;
}

void conclude(FleetState& fleet, RobotNode& robot) {
  Start& start = robot.start;
  start.pose = start.anchor = 0;
  if (!start.given || !isWrong(fleet, robot)) return;
  ++robot.status.wrong_starts;
  const auto right = std::count_if(fleet.robots.begin(), fleet.robots.end(), [&](const RobotNode& other) {
    return &other != &robot && other.start.given && !isWrong(fleet, other);
  });
  fleet.findings.push_back(
      initialPoseWrong(robot.setup.name, start.moved, *start.given, fleet.tied || right > 1));
}

/// `front`: the oldest pose of the window, about to leave it.
void concludeStart(FleetState& fleet, RobotNode& robot, const Step& front, bool leaves) {
  Start& start = robot.start;
  if (start.pose != 0 && front.pose == start.pose) {
    start.moved = fleet.pose(start.pose) * start.given->inverse();
    if (leaves) conclude(fleet, robot);
  }
  if (start.anchor == 0 || front.pose != start.anchor || !leaves) return;
  const Pose2 rest = fleet.pose(start.anchor) * start.anchored.inverse();
  start.moved = rest * start.moved;
  for (PoseEstimate& past : start.history) {
    if (past.acquired_ns >= front.time_ns) break;
    past.map_from_base = rest * past.map_from_base;
    fleet.revised.push_back(past);
  }
  conclude(fleet, robot);
}

PoseEstimate estimateOf(const RobotNode& robot, const Step& step, const Pose2& map_from_base) {
  PoseEstimate estimate;
  estimate.robot = robot.setup.name;
  estimate.acquired_ns = step.time_ns;
  estimate.sequence = step.sequence;
  estimate.valid = true;
  estimate.map_from_base = map_from_base;
  estimate.covariance = robot.covariance;
  estimate.camera_error = robot.camera_aid.published;
  estimate.sightings = step.sightings;
  return estimate;
}

/// @return what is published of the frame now
PoseEstimate revise(FleetState& fleet, RobotNode& robot, const Step& step) {
  const Pose2 now = fleet.pose(step.pose);
  const Pose2 off = step.published->inverse() * now;
  if (off.translation().norm() < kRevise_m && std::abs(off.theta_rad) < kRevise_rad)
    return estimateOf(robot, step, *step.published);
  PoseEstimate estimate = estimateOf(robot, step, now);
  for (PoseEstimate& past : robot.start.history)
    if (past.acquired_ns == step.time_ns) past = estimate;
  fleet.revised.push_back(estimate);
  return estimate;
}

/// The nearest place that was left long before, if a new place is there again and scans relate both.
std::optional<PlaceIndex::Entry> revisited(const FleetState& fleet, const RobotNode& robot, const Step& step,
                                           const Place& place) {
  const std::vector<Place>& own = robot.place_aid.memory.places();
  const std::size_t recent = std::min(own.size(), kApart);
  const bool linked =
      std::any_of(own.end() - static_cast<std::ptrdiff_t>(recent), own.end(), [](const Place& p) {
        return std::any_of(p.links.begin(), p.links.end(),
                           [](const PlaceLink& link) { return link.closes_loop; });
      });
  if (linked || step.scan.factor == kNoFactor) return std::nullopt;
  PlaceRecognition::Scope scope;
  for (std::size_t i = 0; i < fleet.robots.size(); ++i) {
    scope.memories.push_back(&fleet.robots[i].place_aid.memory);
    if (&fleet.robots[i] == &robot) scope.robot = i;
  }
  scope.keyframes = fleet.keyframes.all();
  scope.before_ns = own.size() > kApart ? own[own.size() - kApart].acquired_ns : -1;
  const auto nearest = fleet.recognition.nearest(scope, place.frame_from_base);
  if (!nearest) return std::nullopt;
  const Place& other = scope.memories[nearest->robot]->places()[nearest->index];
  const double distance_m =
      (other.frame_from_base.translation() - place.frame_from_base.translation()).norm();
  return distance_m < kRevisited_m ? nearest : std::nullopt;
}

/// Links a new place to the one at which a search has closed a loop, or which the robot has returned to.
void linkPlace(const FleetState& fleet, RobotNode& robot, const Step& step, Place& place) {
  std::optional<PlaceIndex::Entry> entry;
  const bool closes = robot.place_aid.closing && step.time_ns >= robot.place_aid.closing->time_ns;
  if (closes)
    entry = PlaceIndex::Entry{robot.place_aid.closing->robot, robot.place_aid.closing->index};
  else if (!robot.place_aid.closing)
    entry = revisited(fleet, robot, step, place);
  if (!entry) return;
  const Place& other = fleet.robots[entry->robot].place_aid.memory.places()[entry->index];
  const Pose2 this_from_other = place.frame_from_base.inverse() * other.frame_from_base;
  place.links.push_back({true, other.robot, other.index, this_from_other,
                         closes ? robot.place_aid.closing->covariance
                                : composeCovariance(place.covariance, this_from_other, other.covariance)});
  if (closes) robot.place_aid.closing.reset();
}

/// Makes new places known to the recognition, and reports those that cannot be compared.
void indexPlaces(FleetState& fleet) {
  std::vector<const PlaceMemory*> memories;
  for (const RobotNode& robot : fleet.robots) memories.push_back(&robot.place_aid.memory);
  fleet.recognition.update(memories);
  for (const PlaceIndex::Refusal& refusal : fleet.recognition.takeRefusals())
    fleet.findings.push_back(placesIncomparable(refusal.robot, refusal.why));
}

/// Keeps a frame that leaves the window, relative to the keyframe that its scan met or, without a match, to
/// the latest one.
void remember(FleetState& fleet, RobotNode& robot, const Step& step, PoseEstimate published) {
  const std::optional<KeyframeMap::Id> keyframe = keyframeOf(robot, step);
  if (keyframe)
    robot.place_aid.path.add(published, *keyframe, fleet.keyframes.pose(*keyframe));
  else
    robot.place_aid.path.add(published);
}

}  // namespace

std::optional<KeyframeMap::Id> keyframeOf(const RobotNode& robot, const Step& step) {
  if (step.scan.factor != kNoFactor) return step.scan.keyframe;
  if (robot.scan_aid.anchor && robot.scan_aid.held) return robot.scan_aid.anchor->keyframe;
  return std::nullopt;
}

void rememberPlace(FleetState& fleet, RobotNode& robot, const Step& step, const Pose2& map_from_base,
                   const std::optional<KeyframeMap::Id>& keyframe, bool is_last) {
  robot.place_aid.way =
      composeCovariance(robot.place_aid.way, step.previous_from_current, step.motion_covariance);
  if (!step.appearance && !(is_last && !robot.place_aid.memory.places().empty())) return;
  Place place;
  place.robot = robot.setup.name;
  place.acquired_ns = step.time_ns;
  place.sequence = step.sequence;
  place.frame_from_base = map_from_base;
  place.covariance = robot.covariance;
  place.metric = !fleet.options.appearance.free_scale || robot.appearance_aid.length.isMetric();
  place.format = step.appearance ? step.appearance->format : robot.place_aid.memory.places().back().format;
  if (step.appearance) place.signature = step.appearance->signature;
  linkPlace(fleet, robot, step, place);
  robot.place_aid.memory.add(std::move(place), keyframe, fleet.keyframes, robot.place_aid.way);
  robot.place_aid.way.setZero();
}

void withdraw(FleetState& fleet, RobotNode& robot) {
  robot.start.contradicted = true;
  for (PoseEstimate past : robot.start.history) {
    past.valid = false;
    fleet.revised.push_back(std::move(past));
  }
}

void notePublished(RobotNode& robot, const PoseEstimate& estimate) {
  robot.window.back().published = estimate.map_from_base;
  robot.window.back().sightings = estimate.sightings;
  Start& start = robot.start;
  if (isConfirmed(start) && start.anchor == 0) {
    start.history.clear();
  } else if (start.given && start.history.size() < kMostHistory) {
    start.history.push_back(estimate);
  }
}

void revisePublished(FleetState& fleet, bool last) {
  for (RobotNode& robot : fleet.robots) {
    const auto kept = static_cast<std::size_t>(fleet.options.window_frames);
    const std::size_t leaving =
        last ? robot.window.size() : robot.window.size() - std::min(robot.window.size(), kept);
    if (!robot.located()) continue;
    concludeStart(fleet, robot, robot.window.front(), leaving > 0);
    if (last && isContradicted(fleet, robot) && &robot != &fleet.robots.front()) withdraw(fleet, robot);
    if (last && isContradicted(fleet, robot))
      fleet.findings.push_back(initialPoseContradicted(robot.setup.name));
    for (std::size_t i = 0; i < leaving && !last; ++i) {
      const Step& step = robot.window[i];
      if (step.published) remember(fleet, robot, step, revise(fleet, robot, step));
    }
    for (std::size_t i = 0; i < leaving; ++i) {
      const bool is_last = last && i + 1 == robot.window.size();
      const Step& step = robot.window[i];
      if (step.published)
        rememberPlace(fleet, robot, step, fleet.pose(step.pose), keyframeOf(robot, step), is_last);
    }
  }
  indexPlaces(fleet);
}

}  // namespace omnifleet::estimation
