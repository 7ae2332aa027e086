#include "estimation/localization.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <optional>
#include <vector>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr double kEvent_sigmas = 3.0;  // larger corrections are events
constexpr double kLever_m = 1.0;       // at which a heading's σ counts as one of a position
constexpr double kReachSigmas = 3.0;
constexpr double kEverywhere_m = 1e3;

double sigmasOf(const Pose2& predicted, const Eigen::Matrix3d& covariance, const Pose2& found) {
  const Eigen::Vector3d off = (predicted.inverse() * found).vector();
  return std::sqrt(std::max(0.0, off.dot(covariance.ldlt().solve(off)) / 3.0));
}

/// Puts a robot where the relocalizer has found it.
void moveTo(FleetState& fleet, RobotFrame& frame, const Relocalizer::Found& found) {
  RobotNode& robot = *frame.robot;
  robot.localization_aid.correction_sigmas =
      sigmasOf(fleet.pose(robot.window.back().pose), robot.covariance, found.map_from_base);
  robot.localization_aid.event = PoseEvent::kRelocalized;
  const Eigen::Matrix3d covariance = composeCovariance(fleet.keyframes.covariance(found.keyframe),
                                                       found.keyframe_from_base, found.covariance);
  ScanAid aid = std::move(robot.scan_aid);
  fleet.release(robot);
  fleet.place(robot, *frame.objects, found.map_from_base);
  fleet.graph.addFactor(absolutePoseFactor(found.map_from_base, found.covariance),
                        {robot.window.back().pose});
  robot.window.back().by_search = true;
  robot.scan_aid = std::move(aid);
  robot.scan_aid.anchor = ScanAid::Anchor{found.keyframe, fleet.keyframes.pose(found.keyframe),
                                          found.keyframe_from_base, found.covariance, true};
  robot.scan_aid.way.reset();
  robot.scan_aid.relative_covariance = found.covariance;
  robot.scan_aid.held = true;
  robot.covariance = covariance;
  frame.seen.clear();
  frame.placed_anew = robot.localization_aid.correction_sigmas > kEvent_sigmas;
  if (frame.placed_anew) ++robot.status.losses;
}

/// A return to keyframes that the robot's way does not relate well to it.
void closeLoop(FleetState& fleet, RobotNode& robot, const Relocalizer::Found& found) {
  ScanAid& aid = robot.scan_aid;
  robot.localization_aid.correction_sigmas =
      sigmasOf(fleet.pose(robot.window.back().pose), robot.covariance, found.map_from_base);
  if (robot.localization_aid.correction_sigmas > kEvent_sigmas)
    robot.localization_aid.event = PoseEvent::kLoopClosed;
  else
    robot.localization_aid.correction_sigmas = 0.0;
  const Pose2 from_to = aid.anchor->keyframe_from_base * found.keyframe_from_base.inverse();
  const Eigen::Matrix3d covariance =
      composeCovariance(aid.anchor->covariance, found.keyframe_from_base.inverse(), found.covariance);
  fleet.keyframes.closeLoop(aid.anchor->keyframe, found.keyframe, from_to, covariance);
}

/// Observations determine the pose again, without a search.
void noteFound(const FleetState& fleet, RobotNode& robot, const RobotFrame& frame) {
  if (robot.localization_aid.event != PoseEvent::kNone) return;
  robot.localization_aid.event = PoseEvent::kRelocalized;
  if (frame.predicted)
    robot.localization_aid.correction_sigmas =
        sigmasOf(*frame.predicted, frame.predicted_covariance, fleet.pose(robot.window.back().pose));
}

/// A pose that no search has moved, but whatever else by more than 3 σ of its prediction.
void noteCorrection(const FleetState& fleet, RobotNode& robot, const RobotFrame& frame) {
  if (robot.localization_aid.event != PoseEvent::kNone || !frame.predicted || !robot.located()) return;
  const double sigmas =
      sigmasOf(*frame.predicted, frame.predicted_covariance, fleet.pose(robot.window.back().pose));
  if (!(sigmas > kEvent_sigmas)) return;
  robot.localization_aid.correction_sigmas = sigmas;
  robot.localization_aid.event = robot.absolute_aid.accepted ? PoseEvent::kAbsolute : PoseEvent::kCorrected;
}

/// The newest frame of the window that has a signature, with the robot's way since.
struct SeenPlace {
  std::shared_ptr<const Appearance> appearance;
  Pose2 seen_from_base;
};

std::optional<SeenPlace> newestSeen(const FleetState& fleet, const RobotNode& robot) {
  const auto step = std::find_if(robot.window.rbegin(), robot.window.rend(),
                                 [](const Step& s) { return s.appearance != nullptr; });
  if (step == robot.window.rend()) return std::nullopt;
  return SeenPlace{step->appearance, fleet.pose(step->pose).inverse() * fleet.pose(robot.window.back().pose)};
}

PlaceRecognition::Scope scopeOf(const FleetState& fleet, const RobotNode& robot,
                                const std::vector<KeyframeMap::Id>& among) {
  PlaceRecognition::Scope scope;
  for (std::size_t i = 0; i < fleet.robots.size(); ++i) {
    scope.memories.push_back(&fleet.robots[i].place_aid.memory);
    if (&fleet.robots[i] == &robot) scope.robot = i;
  }
  scope.keyframes = among;
  scope.before_ns = robot.localization_aid.confirmed_ns;
  return scope;
}

/// Where similar places suggest that the robot is, within the area of the search.
std::vector<Relocalizer::Suggestion> suggestionsFor(FleetState& fleet, const PlaceRecognition::Scope& scope,
                                                    const std::optional<SeenPlace>& seen,
                                                    const Relocalizer::Suggestion& area) {
  std::vector<Relocalizer::Suggestion> suggestions;
  if (!seen) return suggestions;
  for (Relocalizer::Suggestion suggestion : fleet.recognition.suggest(scope, *seen->appearance)) {
    suggestion.map_from_base = suggestion.map_from_base * seen->seen_from_base;
    const Pose2 off = area.map_from_base.inverse() * suggestion.map_from_base;
    if (off.translation().norm() > area.reach_m) continue;
    if (suggestion.reach_rad >= area.reach_rad) {
      suggestion.map_from_base.theta_rad = area.map_from_base.theta_rad;
      suggestion.reach_rad = area.reach_rad;
    } else if (std::abs(off.theta_rad) > area.reach_rad) {
      continue;
    }
    suggestions.push_back(suggestion);
  }
  return suggestions;
}

/// The place of this frame, or the next one that the robot keeps, gets a link to the nearest one there.
void linkPlaces(const FleetState& fleet, RobotNode& robot, const PlaceRecognition::Scope& scope,
                const Relocalizer::Found& found) {
  const auto other = fleet.recognition.nearest(scope, found.map_from_base);
  if (!other) return;
  robot.place_aid.closing =
      ClosingLink{robot.window.back().time_ns, other->robot, other->index, found.covariance};
}

/// Whether the scan, and what the robot sees, speak rather against a place that was found than for it: other
/// surfaces around, as in a room with equal walls, or another heading by the compass.
bool isContradicted(FleetState& fleet, const RobotNode& robot, const PlaceRecognition::Scope& scope,
                    const std::optional<SeenPlace>& seen, const Relocalizer::Found& found) {
  const KeyframeMap& map = fleet.keyframes;
  const ScanAid& aid = robot.scan_aid;
  LoopPlace from, to;
  Pose2 map_from_place = found.map_from_base, seen_from_base;
  if (const auto entry = fleet.recognition.nearest(scope, found.map_from_base)) {
    const Place& place = scope.memories[entry->robot]->places()[entry->index];
    map_from_place = place.frame_from_base;
    if (!place.signature.bytes.empty()) {
      from.format = &place.format;
      from.signature = &place.signature;
    }
  }
  for (const KeyframeMap::Id k : map.nearest({found.map_from_base, aid.scan.sectors()}, scope.keyframes)) {
    from.around.push_back(map.reference(k));
    from.around.back().map_from_scan = map_from_place.inverse() * from.around.back().map_from_scan;
  }
  if (seen) {
    to.format = &seen->appearance->format;
    to.signature = &seen->appearance->signature;
    seen_from_base = seen->seen_from_base;
  }
  to.scan = &aid.scan;
  to.base_from_scan = seen_from_base * aid.base_from_scan;
  const Pose2 place_from_seen = map_from_place.inverse() * found.map_from_base * seen_from_base.inverse();
  return fleet.loops.contradicts(from, to, place_from_seen, std::sqrt(found.covariance(2, 2)));
}

/// Searches the robot's place among keyframes. @return where it was found, unless that is contradicted
std::optional<Relocalizer::Found> searchPlace(FleetState& fleet, RobotNode& robot,
                                              const PlaceRecognition::Scope& scope,
                                              const Relocalizer::Suggestion& area) {
  const Step& step = robot.window.back();
  const std::optional<SeenPlace> seen = newestSeen(fleet, robot);
  auto found = robot.localization_aid.relocalizer->look(
      fleet.keyframes, robot.scan_aid, area.map_from_base, step.previous_from_current, scope.keyframes,
      area.reach_m, area.reach_rad, [&] { return suggestionsFor(fleet, scope, seen, area); });
  while (found && isContradicted(fleet, robot, scope, seen, *found))
    found = robot.localization_aid.relocalizer->reject();
  return found;
}

}  // namespace

void localize(FleetState& fleet, RobotFrame& frame) {
  RobotNode& robot = *frame.robot;
  robot.localization_aid.event = PoseEvent::kNone;
  robot.localization_aid.correction_sigmas = 0.0;
  if (!frame.fresh) return;
  const ScanAid& aid = robot.scan_aid;
  LocalizationEvidence evidence;
  evidence.located = robot.located();
  if (robot.located()) {
    const Step& step = robot.window.back();
    evidence.odometry = step.isMeasured() || step.by_appearance;
    // A scan that contradicts an absolute measurement shows what has changed since the keyframes, such as
    // robots.
    evidence.confirmed = aid.matched || robot.absolute_aid.accepted ||
                         (!aid.contradicted && !robot.doubt.displaced && robot.track_aid.unobserved == 0);
    evidence.contradicted = !robot.absolute_aid.accepted && (aid.contradicted || robot.doubt.displaced);
    if (evidence.confirmed) robot.localization_aid.confirmed_ns = step.time_ns;
    evidence.sigma_m = std::sqrt(robot.covariance.topLeftCorner<2, 2>().trace() +
                                 kLever_m * kLever_m * robot.covariance(2, 2));
    const KeyframeMap& map = fleet.keyframes;
    const bool lost = (aid.has_scan && robot.localization_aid.monitor.isInDoubt()) ||
                      robot.localization_aid.monitor.state() == LocalizationState::kLost;
    std::vector<KeyframeMap::Id> among;
    double reach_m = kEverywhere_m, reach_rad = M_PI;
    if (lost) {
      among = map.all();
    } else if (aid.anchor && aid.rich && !aid.contradicted) {
      const double sigma_m = std::sqrt(robot.covariance.topLeftCorner<2, 2>().trace());
      reach_m = kReachSigmas * sigma_m + map.options().spacing_m;
      reach_rad = std::min(M_PI, kReachSigmas * std::sqrt(robot.covariance(2, 2)) + 0.1);
      among = map.unrelated(aid.anchor->keyframe, 0.5 * aid.relative_covariance.topLeftCorner<2, 2>().trace(),
                            fleet.pose(step.pose), reach_m + map.reachM());
    }
    if (among.empty()) {
      robot.localization_aid.relocalizer->forget();
    } else {
      const PlaceRecognition::Scope scope = scopeOf(fleet, robot, among);
      if (const auto found = searchPlace(fleet, robot, scope, {fleet.pose(step.pose), reach_m, reach_rad})) {
        evidence.found = lost;
        linkPlaces(fleet, robot, scope, *found);
        if (lost)
          moveTo(fleet, frame, *found);
        else
          closeLoop(fleet, robot, *found);
        robot.localization_aid.relocalizer->forget();
      }
    }
  }
  if (robot.localization_aid.monitor.update(evidence) == LocalizationState::kRelocalized)
    noteFound(fleet, robot, frame);
  noteCorrection(fleet, robot, frame);
}

Eigen::Matrix3d suspectedMove(const RobotNode& robot) {
  constexpr double kCarried_m = 0.3, kCarried_rad = 0.3;  // rms per patience
  const LocalizationMonitor& monitor = robot.localization_aid.monitor;
  if (!monitor.isInDoubt()) return Eigen::Matrix3d::Zero();
  const double times = std::min(10.0, static_cast<double>(monitor.unconfirmed()) / monitor.patience());
  const double m = kCarried_m * times, rad = std::min(M_PI, kCarried_rad * times);
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

}  // namespace omnifleet::estimation
