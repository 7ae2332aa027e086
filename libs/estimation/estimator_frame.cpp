// What the estimator does with each new frame: admits it, locates its robot, associates and checks its views.
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "estimation/association.h"
#include "estimation/estimator_impl.h"
#include "estimation/factors.h"
#include "estimation/jumps.h"
#include "estimation/locating.h"
#include "estimation/map_frame.h"
#include "estimation/point_alignment.h"
#include "estimation/starts.h"
#include "estimation/troubles.h"

namespace omnifleet::estimation {
namespace {
constexpr double kMisfit_m = 0.05;        // rms of a view after the solve that is no view of this object
constexpr double kSlipInflation = 100.0;  // of the covariance of a step that the other observations reject
constexpr double kFits_m = 0.025, kMuchBetter = 0.5;  // misfit of a frame that is right; share that is less
constexpr int kDoubtRounds = 3;                       // of reweighting, until what was an outlier counts
constexpr double kStartCauchy = 2.0;                  // σ at which an initial pose as configured counts half
}  // namespace

std::vector<FleetEstimator::Impl::Frame> FleetEstimator::Impl::admit(
    const std::vector<const Objects*>& samples) {
  std::vector<Frame> frames;
  for (const Objects* objects : samples) {
    RobotNode* robot = fleet.find(objects->robot);
    if (robot == nullptr) throw std::runtime_error("estimator: unknown robot '" + objects->robot + "'");
    const bool fresh = !robot->started || objects->acquired_ns > robot->last_frame_ns;
    frames.push_back({objects, robot, fresh, {}});
  }
  return frames;
}

void FleetEstimator::Impl::locate(std::vector<Frame>& frames, TimeNs time) {
  std::vector<const Objects*> fresh;
  for (Frame& frame : frames) {
    if (!frame.fresh) continue;
    RobotNode& robot = *frame.robot;
    robot.absolute_aid.accepted = false;
    robot.absolute_aid.used = robot.absolute_aid.rejected = {};
    robot.absolute_aid.fix.reset();
    if (robot.located()) {
      if (!robot.window.back().keyframe) fleet.dropViews(robot.window.back());
      frame.after_gap = isAfterGap(robot, frame.objects->acquired_ns);
      const Eigen::Matrix3d before = robot.covariance;
      fleet.advance(robot, *frame.objects);
      const Step& step = robot.window.back();
      frame.predicted = fleet.pose(step.pose);
      frame.predicted_covariance =
          composeCovariance(before, step.previous_from_current, step.motion_covariance);
      ++robot.track_aid.unobserved;
    } else if (!robot.started && robot.setup.initial_pose) {
      placeInitially(robot, *frame.objects);
    }
    if (!robot.located()) advanceScout(fleet, robot, *frame.objects);
    robot.started = true;
    frame.seen = silhouettes(fleet, *frame.objects);
    tryWheels(fleet, frame, std::exchange(robot.last_frame_ns, frame.objects->acquired_ns));
    fresh.push_back(frame.objects);
  }
  queue_.attach(fleet, time, fresh);
  for (const Frame& frame : frames)
    if (frame.fresh && frame.robot->located()) startAtFix(frame);
  for (Frame& frame : frames) {
    if (!frame.fresh || frame.robot->located()) continue;
    if (!locateByPoints(fleet, *frame.robot, *frame.objects) && frame.robot->sightings_locate)
      locateBySightings(fleet, *frame.robot, *frame.objects, fresh);
  }
  fleet.shareKeyframes(time);
}

/// Scans and views are matched from where absolute measurements put the new frame.
void FleetEstimator::Impl::startAtFix(const Frame& frame) {
  const RobotNode& robot = *frame.robot;
  if (!robot.absolute_aid.fix || !frame.predicted || robot.window.back().motion == kNoFactor) return;
  const AbsoluteFix start =
      AbsoluteFix::fuse({*frame.predicted, frame.predicted_covariance}, *robot.absolute_aid.fix);
  Eigen::VectorXd& value = fleet.graph.value(robot.window.back().pose);
  value.head<2>() = start.map_from_base.translation();
  value(2) += wrapAngle(start.map_from_base.theta_rad - value(2));
}

/// The initial pose is that of the first frame, or of the first row of the wheels where they come earlier.
void FleetEstimator::Impl::placeInitially(RobotNode& robot, const Objects& frame) {
  Pose2 map_from_base = *robot.setup.initial_pose;
  const double m = fleet.options.initial_sigma_m, rad = fleet.options.initial_sigma_rad;
  Eigen::Matrix3d covariance = Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
  WheelLog::Motion way;
  if (robot.wheel_aid.log && !robot.wheel_aid.log->empty() &&
      robot.wheel_aid.log->between(
          robot.wheel_aid.log->firstTime(), frame.acquired_ns, robot.setup.body.wheel_separation_m,
          fleet.graph.value(robot.wheel_aid.model), robot.wheel_aid.delay_sigma_s, way)) {
    covariance = composeCovariance(covariance, way.previous_from_current, way.covariance);
    map_from_base = map_from_base * way.previous_from_current;
  }
  fleet.place(robot, frame, map_from_base);
  robot.covariance = covariance;
  robot.start.given = map_from_base;
  robot.start.pose = robot.window.back().pose;
  if (robot.setup.founds_map) {
    foundMap(fleet, robot.window.back().pose, map_from_base, covariance);
    return;
  }
  fleet.graph.addFactor(absolutePoseFactor(map_from_base, covariance), {robot.window.back().pose},
                        kStartCauchy);
}

void FleetEstimator::Impl::associate(std::vector<Frame>& frames) {
  std::vector<RobotNode*> fresh;
  for (Frame& frame : frames) {
    if (!frame.fresh || !frame.robot->located()) continue;
    noteSight(*frame.robot, *frame.objects, frame.seen);
    if (!frame.robot->scan_aid.suffices) fresh.push_back(frame.robot);
  }
  checkStarts(fleet, fresh);
  for (Frame& frame : frames) {
    if (!frame.isPlaced()) continue;
    followUnseen(fleet, *frame.robot, frame.follows());
    frame.robot->doubt.unsettled_m += frame.robot->window.back().rolled_m;
    frame.robot->doubt.unsettled_rad += frame.robot->window.back().rolled_rad;
  }
  for (Frame& frame : frames) {
    if (!frame.isPlaced() || frame.robot->scan_aid.suffices) continue;
    alignByTracks(fleet, *frame.robot, *frame.objects, frame.seen);
  }
  noticeJumps(fleet, frames);
  for (Frame& frame : frames) {
    if (!frame.isPlaced()) continue;
    associateOne(frame);
    const bool by_scan = frame.robot->scan_aid.suffices;
    if (by_scan) frame.robot->doubt.displaced = frame.robot->doubt.adrift = false;
    if (frame.sees() && !by_scan) noticeLoss(fleet, frame);
    if (fleet.options.use_landmarks && !by_scan) foundLandmarks(fleet, *frame.robot, frame.seen);
    addViews(fleet, *frame.robot, frame.seen);
  }
  noteObserved(frames);
}

void FleetEstimator::Impl::associateOne(Frame& frame) {
  if (fleet.options.use_sightings) matchPeers(fleet, *frame.robot, *frame.objects, frame.seen);
  if (fleet.options.use_landmarks && !frame.robot->scan_aid.suffices)
    matchLandmarks(fleet, *frame.robot, frame.seen);
}

void FleetEstimator::Impl::reweight() {
  for (RobotNode& robot : fleet.robots) {
    for (Step& step : robot.window) reweight(robot, step);
  }
}

void FleetEstimator::Impl::reweight(RobotNode& robot, Step& step) {
  for (ViewLink& link : step.views) {
    if (!fleet.graph.hasFactor(link.factor)) continue;
    link.view->assume(fleet.cameraError(robot));
    const double* values[] = {fleet.graph.value(link.observer).data(), fleet.graph.value(link.object).data(),
                              fleet.graph.value(link.camera).data(), fleet.graph.value(link.size).data()};
    link.rms_m = link.cost->reweight(values);
    // Where the pose is in doubt all views misfit, and they are right.
    if ((isConfirmed(robot.start) || link.weighed) && !robot.doubt.unseen && robot.doubt.unsure == 0)
      link.cost->discount();
  }
}

void FleetEstimator::Impl::checkViews(std::vector<Frame>& frames) {
  bool removed = false;
  for (Frame& frame : frames) {
    if (!frame.fresh || !frame.robot->located()) continue;
    reweight(*frame.robot, frame.robot->window.back());
    auto& views = frame.robot->window.back().views;
    for (auto at = views.begin(); at != views.end();) {
      const bool misfit = at->rms_m > kMisfit_m;
      if (at->landmark != 0) {
        Landmark& landmark = fleet.landmarks.at(at->landmark);
        landmark.misfits = misfit ? landmark.misfits + 1 : 0;
      }
      if (misfit) {
        ++frame.robot->status.rejected_views;
        frame.rejected.add(at->landmark != 0 ? Source::kLandmarks : Source::kSightings);
        fleet.graph.removeFactor(at->factor);
        for (Seen& seen : frame.seen) {
          if (seen.track->id == at->track) seen.peer = nullptr, seen.landmark = 0;
        }
      }
      removed = removed || misfit;
      at = misfit ? views.erase(at) : std::next(at);
    }
  }
  if (removed) solveNewest(frames);
}

void FleetEstimator::Impl::checkSteps(std::vector<Frame>& frames) {
  bool any = false;
  for (Frame& frame : frames) {
    RobotNode& robot = *frame.robot;
    if (!frame.fresh || frame.slipped || frame.floor_rejected || !robot.located()) continue;
    Step& step = robot.window.back();
    if (!step.isMeasured() || step.motion == kNoFactor || frame.placed_anew) continue;
    if (fleet.graph.squaredNorm(step.motion) <= fleet.options.gate_chi2) continue;
    const double inflation = std::max(kSlipInflation, fleet.graph.squaredNorm(step.motion));
    fleet.loosen(robot, inflation * step.motion_covariance);
    rejectStep(frame);
    any = true;
  }
  if (any) solveNewest(frames);
  for (Frame& frame : frames) doubtStep(frame, frames);
}

/// misfit() of the newest frame, after several solves where it is large: what was an outlier in one counts in
/// the next.
double FleetEstimator::Impl::solvedMisfit(RobotNode& robot, std::vector<Frame>& frames) {
  for (int round = 0;; ++round) {
    reweight(robot, robot.window.back());
    const double misfit_m = misfit(fleet, robot.window.back().views);
    if (misfit_m < kFits_m || round == kDoubtRounds) return misfit_m;
    solveNewest(frames);
  }
}

/// After a slip few observations are outliers one by one. The step is wrong if all fit much better without
/// it.
void FleetEstimator::Impl::doubtStep(Frame& frame, std::vector<Frame>& frames) {
  RobotNode& robot = *frame.robot;
  if (!frame.fresh || frame.slipped || frame.floor_rejected || frame.placed_anew || !robot.located()) return;
  const Step& step = robot.window.back();
  if (!step.isMeasured() || step.motion == kNoFactor) return;
  const double misfit_m = solvedMisfit(robot, frames);
  if (misfit_m < kFits_m) return;
  const Eigen::Matrix3d given = step.motion_covariance;
  fleet.loosen(robot, given + slipCovariance());
  if (solvedMisfit(robot, frames) < kMuchBetter * misfit_m) {
    rejectStep(frame);
    return;
  }
  fleet.loosen(robot, given);
  solveNewest(frames);
}

}  // namespace omnifleet::estimation
