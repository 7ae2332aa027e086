#include "estimation/estimator.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "estimation/association.h"
#include "estimation/factors.h"
#include "estimation/fleet_state.h"
#include "estimation/joining.h"
#include "estimation/jumps.h"
#include "estimation/localization.h"
#include "estimation/locating.h"
#include "estimation/map_frame.h"
#include "estimation/measurements.h"
#include "estimation/point_alignment.h"
#include "estimation/starts.h"
#include "estimation/told.h"
#include "estimation/troubles.h"
#include "estimation/uncertainty.h"

namespace omnifleet::estimation {
namespace {
constexpr double kMisfit_m = 0.05;        // rms of a view after the solve that is no view of this object
constexpr double kSlipInflation = 100.0;  // of the covariance of a step that the rest refutes
constexpr int kFinalIterations = 30;
constexpr double kFits_m = 0.025, kMuchBetter = 0.5;  // misfit of a frame that is right; share that is less
constexpr int kDoubtRounds = 3;                       // of reweighting, until what was an outlier counts
// By so much a published frame must be off before it is published again: while driving, at the end.
constexpr double kPathMoved_m = 0.005, kPathMoved_rad = 0.005, kSettled_m = 0.001, kSettled_rad = 0.001;
constexpr std::uint32_t kNothingFollowed = 0xffffffffU;
constexpr double kStartCauchy = 2.0;  // σ at which a start as it was told counts half
}  // namespace

class FleetEstimator::Impl {
 public:
  Impl(std::vector<RobotSetup> robots, const EstimatorOptions& options)
      : fleet(std::move(robots), options), scans_(options.scan, options.match) {}

  std::vector<PoseEstimate> process(TimeNs time, const std::vector<const Objects*>& frames,
                                    const std::vector<const Measurement*>& measurements);
  void refine();
  bool refineDue() const;
  std::vector<PoseEstimate> smoothed() const;
  void settle(int rounds);
  void followPaths(double moved_m, double moved_rad);
  void learnScale(RobotNode& robot);

  RobotNode& node(const std::string& robot) {
    RobotNode* found = fleet.find(robot);
    if (found == nullptr) throw std::runtime_error("estimator: unknown robot '" + robot + "'");
    return *found;
  }

  FleetState fleet;

 private:
  using Frame = RobotFrame;

  std::vector<Frame> admit(const std::vector<const Objects*>& frames);
  void locate(std::vector<Frame>& frames, TimeNs time);
  void startAtFix(const Frame& frame);
  void placeInitially(RobotNode& robot, const Objects& frame);
  void associate(std::vector<Frame>& frames);
  void associateOne(Frame& frame);
  void reweight();
  void reweight(RobotNode& robot, Step& step);
  void solveNewest(std::vector<Frame>& frames);
  void checkViews(std::vector<Frame>& frames);
  void checkSteps(std::vector<Frame>& frames);
  double solvedMisfit(RobotNode& robot, std::vector<Frame>& frames);
  void doubtStep(Frame& frame, std::vector<Frame>& frames);
  void condense();
  std::vector<PoseEstimate> report(const std::vector<Frame>& frames);

  MeasurementQueue queue_;
  ScanSource scans_;
  bool settled_ = false;        ///< at the end of a run
  std::uint32_t followed_ = 0;  ///< revision of the keyframes that the published paths follow
  bool whole_ = false;          ///< the newest frames went through a solve of the whole window already
};

std::vector<PoseEstimate> FleetEstimator::Impl::process(TimeNs time,
                                                        const std::vector<const Objects*>& samples,
                                                        const std::vector<const Measurement*>& measurements) {
  std::vector<Frame> frames = admit(samples);
  for (const Measurement* m : measurements) queue_.push(*m);
  if (frames.empty()) return {};
  const auto unrefined = [](const Frame& frame) { return frame.fresh && frame.robot->unrefined; };
  if (std::any_of(frames.begin(), frames.end(), unrefined)) refine();
  locate(frames, time);
  for (Frame& frame : frames) scans_.observe(fleet, frame);
  for (Frame& frame : frames) noteRejectedWheels(fleet, frame);
  associate(frames);
  solveNewest(frames);
  checkSteps(frames);  // before views are held against poses that slipping wheels hold where they are not, …
  checkViews(frames);
  checkSteps(frames);  // … and where a wrong view hid it
  updateUncertainty(fleet, whole_, settled_);
  noticeCarried(fleet, frames);
  for (Frame& frame : frames) localize(fleet, frame);
  for (const Frame& frame : frames) noteState(fleet, frame);
  for (Frame& frame : frames) frame.robot->unrefined |= frame.fresh;
  return report(frames);
}

/// By the new frames and what the window says, condensed; by the whole window where that does not apply.
void FleetEstimator::Impl::solveNewest(std::vector<Frame>& frames) {
  for (Frame& frame : frames) {
    if (frame.fresh && frame.robot->located()) reweight(*frame.robot, frame.robot->window.back());
  }
  if (fleet.graph.solveNewest(fleet.options.solver_iterations)) {
    whole_ = false;
    return;
  }
  reweight();
  fleet.graph.solve(fleet.options.solver_iterations);
  whole_ = true;
}

void FleetEstimator::Impl::refine() {
  if (!whole_) {
    reweight();
    fleet.graph.solve(fleet.options.solver_iterations);
  }
  for (RobotNode& robot : fleet.robots) {
    for (Step& step : robot.window) {
      for (ViewLink& link : step.views) link.weighed = true;
    }
    noteFits(fleet, robot);
    learnScale(robot);
  }
  whole_ = false;
  fleet.updateShapes();
  releaseFrame(fleet);
  fleet.forgetLandmarks();
  reviseTold(fleet, false);
  scans_.keep(fleet);
  followPaths(kPathMoved_m, kPathMoved_rad);
  fleet.slide();
  fleet.forgetWheels();
  holdFrame(fleet);
  condense();
  for (RobotNode& robot : fleet.robots) robot.unrefined = false;
}

/// Steps between two frames that scans have placed tell how long a unit of the distance of signatures is.
void FleetEstimator::Impl::learnScale(RobotNode& robot) {
  if (!robot.unrefined || robot.window.size() < 2) return;
  const Step &from = robot.window[robot.window.size() - 2], &to = robot.window.back();
  if (!(to.difference > 0) || to.scan.factor == kNoFactor || from.scan.factor == kNoFactor) return;
  robot.difference_scale.add((fleet.pose(to.pose).translation() - fleet.pose(from.pose).translation()).norm(),
                             to.difference);
}

/// Frames that have left the window move with the keyframes that they were matched with.
void FleetEstimator::Impl::followPaths(double moved_m, double moved_rad) {
  if (fleet.keyframes.revision() == followed_) return;
  followed_ = fleet.keyframes.revision();
  for (RobotNode& robot : fleet.robots) {
    robot.path.follow(fleet.keyframes, moved_m, moved_rad, fleet.revised);
    robot.places.follow(fleet.keyframes, moved_m, moved_rad);
  }
}

bool FleetEstimator::Impl::refineDue() const {
  constexpr TimeNs kSending_ns = 500000000;  // a robot that was silent for longer is not waited for
  TimeNs newest = 0;
  for (const RobotNode& robot : fleet.robots) newest = std::max(newest, robot.last_frame_ns);
  bool any = false;
  for (const RobotNode& robot : fleet.robots) {
    any = any || robot.unrefined;
    if (robot.started && !robot.unrefined && newest - robot.last_frame_ns <= kSending_ns) return false;
  }
  return any;
}

/// What the window says of all that new frames can touch. Views of frames that were no keyframes are left
/// out: they go with the robot's next frame.
void FleetEstimator::Impl::condense() {
  std::vector<VariableId> kept;
  std::vector<FactorId> without;
  for (const RobotNode& robot : fleet.robots) {
    kept.push_back(robot.wheels);
    if (robot.detector != 0) kept.push_back(robot.detector);
    if (robot.camera != 0) kept.push_back(robot.camera);
    if (robot.size != 0) kept.push_back(robot.size);
    if (!robot.located()) continue;
    kept.push_back(robot.window.back().pose);
    if (robot.window.back().keyframe) continue;
    for (const ViewLink& link : robot.window.back().views) without.push_back(link.factor);
  }
  for (const auto& [id, landmark] : fleet.landmarks) {
    kept.push_back(landmark.variable);
    kept.push_back(landmark.size);
  }
  for (const auto& [name, point] : fleet.points) kept.push_back(point.variable);
  fleet.graph.condense(kept, without);
}

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
    robot.measured = false;
    robot.fix.reset();
    if (robot.located()) {
      if (!robot.window.back().keyframe) fleet.dropViews(robot.window.back());
      frame.after_gap = isAfterGap(robot, frame.objects->acquired_ns);
      const Eigen::Matrix3d before = robot.covariance;
      fleet.advance(robot, *frame.objects);
      const Step& step = robot.window.back();
      frame.predicted = fleet.pose(step.pose);
      frame.predicted_covariance =
          composeCovariance(before, step.previous_from_current, step.motion_covariance);
      ++robot.unobserved;
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
  if (!robot.fix || !frame.predicted || robot.window.back().motion == kNoFactor) return;
  const AbsoluteFix start = AbsoluteFix::fuse({*frame.predicted, frame.predicted_covariance}, *robot.fix);
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
  if (robot.log && !robot.log->empty() &&
      robot.log->between(robot.log->firstTime(), frame.acquired_ns, robot.setup.body.wheel_separation_m,
                         fleet.graph.value(robot.wheels), robot.delay_sigma_s, way)) {
    covariance = composeCovariance(covariance, way.previous_from_current, way.covariance);
    map_from_base = map_from_base * way.previous_from_current;
  }
  fleet.place(robot, frame, map_from_base);
  robot.covariance = covariance;
  robot.start.told = map_from_base;
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
    frame.robot->unsettled_m += frame.robot->window.back().rolled_m;
    frame.robot->unsettled_rad += frame.robot->window.back().rolled_rad;
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
    if (by_scan) frame.robot->displaced = frame.robot->adrift = false;
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
    if ((isConfirmed(robot.start) || link.weighed) && !robot.unseen && robot.unsure == 0)
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
    if (!frame.fresh || frame.slipped || !robot.located()) continue;
    Step& step = robot.window.back();
    if (!step.wheels || step.motion == kNoFactor || frame.placed_anew) continue;
    if (fleet.graph.squaredNorm(step.motion) <= fleet.options.gate_chi2) continue;
    const double inflation = std::max(kSlipInflation, fleet.graph.squaredNorm(step.motion));
    fleet.loosen(robot, inflation * step.motion_covariance);
    tellSlip(frame);
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

/// To wheels that slipped few things are outliers one by one. It is the step that is wrong where things fit
/// much better without it.
void FleetEstimator::Impl::doubtStep(Frame& frame, std::vector<Frame>& frames) {
  RobotNode& robot = *frame.robot;
  if (!frame.fresh || frame.slipped || frame.placed_anew || !robot.located()) return;
  const Step& step = robot.window.back();
  if (!step.wheels || step.motion == kNoFactor) return;
  const double misfit_m = solvedMisfit(robot, frames);
  if (misfit_m < kFits_m) return;
  const Eigen::Matrix3d told = step.motion_covariance;
  fleet.loosen(robot, told + slipCovariance());
  if (solvedMisfit(robot, frames) < kMuchBetter * misfit_m) {
    tellSlip(frame);
    return;
  }
  fleet.loosen(robot, told);
  solveNewest(frames);
}

std::vector<PoseEstimate> FleetEstimator::Impl::report(const std::vector<Frame>& frames) {
  std::vector<PoseEstimate> estimates;
  for (const Frame& frame : frames) {
    PoseEstimate estimate;
    estimate.robot = frame.objects->robot;
    estimate.acquired_ns = frame.objects->acquired_ns;
    estimate.sequence = frame.objects->sequence;
    RobotNode& robot = *frame.robot;
    // Lost by its landmarks a robot has no pose; by its scan it has one whose covariance says so.
    estimate.valid = frame.fresh && robot.located() && robot.status.state != RobotState::kLost &&
                     robot.monitor.state() != LocalizationState::kLost;
    estimate.state = robot.monitor.state();
    estimate.event = robot.event;
    estimate.correction_sigmas = robot.correction_sigmas;
    if (estimate.valid) {
      estimate.map_from_base = fleet.pose(robot.window.back().pose);
      estimate.covariance = robot.covariance;
      estimate.datum = fleet.map_frame.datum;
      estimate.camera_error = robot.camera_told;
      estimate.covariance += suspectedMove(robot);
      for (const Seen& seen : frame.seen) {
        if (seen.peer != nullptr) estimate.sightings.push_back({seen.track->id, seen.peer->setup.name});
      }
      noteTold(robot, estimate);
    }
    estimates.push_back(std::move(estimate));
  }
  return estimates;
}

std::vector<PoseEstimate> FleetEstimator::Impl::smoothed() const {
  std::vector<PoseEstimate> all;
  for (const RobotNode& robot : fleet.robots) {
    for (const Step& step : robot.window) {
      PoseEstimate estimate;
      estimate.robot = robot.setup.name;
      estimate.acquired_ns = step.time_ns;
      estimate.sequence = step.sequence;
      estimate.valid = !robot.start.contradicted;
      estimate.map_from_base = fleet.pose(step.pose);
      estimate.covariance = robot.covariance;
      estimate.datum = fleet.map_frame.datum;
      estimate.camera_error = robot.camera_told;
      all.push_back(std::move(estimate));
    }
  }
  return all;
}

void FleetEstimator::Impl::settle(int rounds) {
  for (int i = 0; i < rounds; ++i) {
    reweight();
    fleet.graph.solve(kFinalIterations);
    fleet.updateShapes();
  }
  settled_ = whole_ = true;
  followed_ = kNothingFollowed;
  followPaths(kSettled_m, kSettled_rad);
  updateUncertainty(fleet, whole_, settled_);
  reviseTold(fleet, true);
}

std::vector<PoseEstimate> FleetEstimator::takeRevised() {
  return std::exchange(impl_->fleet.revised, {});
}

std::vector<Message> FleetEstimator::takeFindings() {
  return std::exchange(impl_->fleet.findings, {});
}

FleetEstimator::FleetEstimator(std::vector<RobotSetup> robots, const EstimatorOptions& options)
    : impl_(std::make_unique<Impl>(std::move(robots), options)) {}
FleetEstimator::~FleetEstimator() = default;
FleetEstimator::FleetEstimator(FleetEstimator&&) noexcept = default;
FleetEstimator& FleetEstimator::operator=(FleetEstimator&&) noexcept = default;

std::vector<PoseEstimate> FleetEstimator::process(TimeNs time, const std::vector<const Objects*>& frames,
                                                  const std::vector<const Measurement*>& measurements) {
  return impl_->process(time, frames, measurements);
}

void FleetEstimator::refine() {
  impl_->refine();
}

bool FleetEstimator::refineDue() const {
  return impl_->refineDue();
}

std::vector<PoseEstimate> FleetEstimator::finish() {
  impl_->settle(3);
  return impl_->smoothed();
}

std::vector<PoseEstimate> FleetEstimator::smoothed() const {
  return impl_->smoothed();
}

void FleetEstimator::join(const std::string& robot, const FleetEstimator& own, const Pose2& map_from_own,
                          const Eigen::Matrix3d& covariance) {
  joinRobot(impl_->fleet, impl_->node(robot), own.impl_->fleet, map_from_own, covariance);
}

void FleetEstimator::adoptPath(const std::string& robot, const FleetEstimator& own) {
  RobotNode& node = impl_->node(robot);
  const RobotNode& theirs = own.impl_->node(robot);
  if (!node.located() || !theirs.located()) return;
  const Pose2 map_from_own =
      impl_->fleet.pose(node.window.back().pose) * own.impl_->fleet.pose(theirs.window.back().pose).inverse();
  estimation::adoptPath(impl_->fleet, node, own.impl_->fleet, map_from_own);
}

const KeyframeMap& FleetEstimator::keyframes() const {
  return impl_->fleet.keyframes;
}

bool FleetEstimator::isLocated(const std::string& robot) const {
  return impl_->node(robot).located();
}

void FleetEstimator::allowSightings(const std::string& robot, bool allow) {
  impl_->node(robot).sightings_locate = allow;
}

std::vector<Place> FleetEstimator::takePlaces() {
  std::vector<Place> changed;
  for (RobotNode& robot : impl_->fleet.robots)
    for (const std::uint32_t index : robot.places.takeChanged())
      changed.push_back(robot.places.places()[index]);
  return changed;
}

std::vector<LandmarkEstimate> FleetEstimator::landmarks() const {
  return impl_->fleet.landmarkEstimates();
}

void FleetEstimator::addWheels(const std::string& robot, TimeNs time_ns, double left_mps, double right_mps) {
  impl_->fleet.addWheels(impl_->node(robot), time_ns, left_mps, right_mps);
}

std::vector<PointEstimate> FleetEstimator::points() const {
  std::vector<PointEstimate> all;
  for (const auto& [name, point] : impl_->fleet.points) {
    all.push_back(
        {name, impl_->fleet.graph.value(point.variable), point.covariance, point.surveyed, point.views});
  }
  return all;
}

WheelModel FleetEstimator::wheelModel(const std::string& robot) const {
  return impl_->fleet.graph.value(impl_->node(robot).wheels);
}

DetectorModel FleetEstimator::detectorModel(const std::string& robot) const {
  const RobotNode& node = impl_->node(robot);
  if (node.detector == 0) return DetectorModel::Zero();
  return impl_->fleet.graph.value(node.detector);
}

Eigen::Vector2d FleetEstimator::seenFrom(const std::string& robot, TimeNs time_ns,
                                         const Eigen::Vector2d& range_bearing) const {
  return impl_->fleet.seenFrom(impl_->node(robot), time_ns, range_bearing);
}

CameraError FleetEstimator::cameraError(const std::string& robot) const {
  return impl_->fleet.cameraError(impl_->node(robot));
}

CameraCovariance FleetEstimator::cameraCovariance(const std::string& robot) const {
  return impl_->node(robot).camera_covariance;
}

const RobotStatus& FleetEstimator::status(const std::string& robot) const {
  return impl_->node(robot).status;
}

}  // namespace omnifleet::estimation
