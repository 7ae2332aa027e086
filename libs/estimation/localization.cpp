#include "estimation/localization.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

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
  robot.correction_sigmas =
      sigmasOf(fleet.pose(robot.window.back().pose), robot.covariance, found.map_from_base);
  robot.event = PoseEvent::kRelocalized;
  const Eigen::Matrix3d covariance = composeCovariance(fleet.keyframes.covariance(found.keyframe),
                                                       found.keyframe_from_base, found.covariance);
  ScanAid aid = std::move(robot.scan_aid);
  fleet.release(robot);
  fleet.place(robot, *frame.objects, found.map_from_base);
  fleet.graph.addFactor(absolutePoseFactor(found.map_from_base, found.covariance),
                        {robot.window.back().pose});
  robot.scan_aid = std::move(aid);
  robot.scan_aid.anchor = ScanAid::Anchor{found.keyframe, fleet.keyframes.pose(found.keyframe),
                                          found.keyframe_from_base, found.covariance, true};
  robot.scan_aid.way.reset();
  robot.scan_aid.relative_covariance = found.covariance;
  robot.scan_aid.held = true;
  robot.covariance = covariance;
  frame.seen.clear();
  frame.placed_anew = robot.correction_sigmas > kEvent_sigmas;
  if (frame.placed_anew) ++robot.status.losses;
}

/// A return to keyframes that the robot's way does not relate well to it.
void closeLoop(FleetState& fleet, RobotNode& robot, const Relocalizer::Found& found) {
  ScanAid& aid = robot.scan_aid;
  robot.correction_sigmas =
      sigmasOf(fleet.pose(robot.window.back().pose), robot.covariance, found.map_from_base);
  if (robot.correction_sigmas > kEvent_sigmas)
    robot.event = PoseEvent::kLoopClosed;
  else
    robot.correction_sigmas = 0.0;
  const Pose2 from_to = aid.anchor->keyframe_from_base * found.keyframe_from_base.inverse();
  const Eigen::Matrix3d covariance =
      composeCovariance(aid.anchor->covariance, found.keyframe_from_base.inverse(), found.covariance);
  fleet.keyframes.closeLoop(aid.anchor->keyframe, found.keyframe, from_to, covariance);
}

/// A pose that no search has moved, but whatever else by more than 3 σ of its prediction.
void noteCorrection(const FleetState& fleet, RobotNode& robot, const RobotFrame& frame) {
  if (robot.event != PoseEvent::kNone || !frame.predicted || !robot.located()) return;
  const double sigmas =
      sigmasOf(*frame.predicted, frame.predicted_covariance, fleet.pose(robot.window.back().pose));
  if (!(sigmas > kEvent_sigmas)) return;
  robot.correction_sigmas = sigmas;
  robot.event = robot.measured ? PoseEvent::kAbsolute : PoseEvent::kCorrected;
}

}  // namespace

void localize(FleetState& fleet, RobotFrame& frame) {
  RobotNode& robot = *frame.robot;
  robot.event = PoseEvent::kNone;
  robot.correction_sigmas = 0.0;
  if (!frame.fresh) return;
  const ScanAid& aid = robot.scan_aid;
  LocalizationEvidence evidence;
  evidence.located = robot.located();
  if (robot.located()) {
    const Step& step = robot.window.back();
    evidence.odometry = step.wheels || step.by_appearance;
    // A scan that contradicts an absolute measurement shows what has changed since the keyframes, such as
    // robots.
    evidence.confirmed =
        aid.matched || robot.measured || (!aid.contradicted && !robot.displaced && robot.unobserved == 0);
    evidence.contradicted = !robot.measured && (aid.contradicted || robot.displaced);
    evidence.sigma_m = std::sqrt(robot.covariance.topLeftCorner<2, 2>().trace() +
                                 kLever_m * kLever_m * robot.covariance(2, 2));
    const KeyframeMap& map = fleet.keyframes;
    const bool lost =
        (aid.has_scan && robot.monitor.isInDoubt()) || robot.monitor.state() == LocalizationState::kLost;
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
      robot.relocalizer->forget();
    } else if (const auto found = robot.relocalizer->look(
                   map, aid, fleet.pose(step.pose), step.previous_from_current, among, reach_m, reach_rad)) {
      evidence.found = lost;
      if (lost)
        moveTo(fleet, frame, *found);
      else
        closeLoop(fleet, robot, *found);
      robot.relocalizer->forget();
    }
  }
  robot.monitor.update(evidence);
  noteCorrection(fleet, robot, frame);
}

Eigen::Matrix3d suspectedMove(const RobotNode& robot) {
  constexpr double kCarried_m = 0.3, kCarried_rad = 0.3;  // rms per patience
  const LocalizationMonitor& monitor = robot.monitor;
  if (!monitor.isInDoubt()) return Eigen::Matrix3d::Zero();
  const double times = std::min(10.0, static_cast<double>(monitor.unconfirmed()) / monitor.patience());
  const double m = kCarried_m * times, rad = std::min(M_PI, kCarried_rad * times);
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

}  // namespace omnifleet::estimation
