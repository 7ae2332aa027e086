#include "estimation/estimator.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/estimator_impl.h"
#include "estimation/joining.h"
#include "estimation/localization.h"
#include "estimation/map_frame.h"
#include "estimation/published_poses.h"
#include "estimation/sources.h"
#include "estimation/starts.h"
#include "estimation/troubles.h"
#include "estimation/uncertainty.h"

namespace omnifleet::estimation {
namespace {
constexpr int kFinalIterations = 30;
// By so much a published frame must be off before it is published again: while driving, at the end.
constexpr double kPathMoved_m = 0.005, kPathMoved_rad = 0.005, kSettled_m = 0.001, kSettled_rad = 0.001;
constexpr std::uint32_t kNothingFollowed = 0xffffffffU;
}  // namespace

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
    learnAppearance(robot);
    if (robot.unrefined && robot.located()) robot.floor.learn(fleet, robot);
  }
  whole_ = false;
  fleet.updateShapes();
  releaseFrame(fleet);
  fleet.forgetLandmarks();
  revisePublished(fleet, false);
  scans_.keep(fleet);
  followPaths(kPathMoved_m, kPathMoved_rad);
  fleet.slide();
  fleet.forgetWheels();
  holdFrame(fleet);
  condense();
  for (RobotNode& robot : fleet.robots) robot.unrefined = false;
}

/// Estimates the length of a unit of signature distance, and the errors of the compass, from the newest step.
void FleetEstimator::Impl::learnAppearance(RobotNode& robot) {
  if (!robot.unrefined || robot.window.size() < 2) return;
  const Step &from = robot.window[robot.window.size() - 2], &to = robot.window.back();
  const bool by_scans = to.scan.factor != kNoFactor && from.scan.factor != kNoFactor;
  const Pose2 moved = fleet.pose(from.pose).inverse() * fleet.pose(to.pose);
  if (by_scans && to.difference > 0)
    robot.appearance_aid.length.add(moved.translation().norm(), to.difference, wrapAngle(moved.theta_rad));
  if (!to.compass) return;
  const auto variance = [](const ScanLink& link) {
    return link.information(2, 2) > 0 ? 1.0 / link.information(2, 2) : M_PI * M_PI;
  };
  if (by_scans) {
    robot.appearance_aid.compass.add(wrapAngle(to.compass->turn_rad - moved.theta_rad), to.compass->sigma_rad,
                                     {std::sqrt(variance(from.scan) + variance(to.scan)), false});
  } else if (to.wheels && !to.wheels_rejected) {
    robot.appearance_aid.compass.add(wrapAngle(to.compass->turn_rad - to.previous_from_current.theta_rad),
                                     to.compass->sigma_rad, {std::sqrt(to.motion_covariance(2, 2)), true});
  }
}

/// Frames that have left the window move with the keyframes that they were matched with.
void FleetEstimator::Impl::followPaths(double moved_m, double moved_rad) {
  if (fleet.keyframes.revision() == followed_) return;
  followed_ = fleet.keyframes.revision();
  for (RobotNode& robot : fleet.robots) {
    robot.place_aid.path.follow(fleet.keyframes, moved_m, moved_rad, fleet.revised);
    robot.place_aid.memory.follow(fleet.keyframes, moved_m, moved_rad);
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
    kept.push_back(robot.wheel_aid.model);
    if (robot.detector != 0) kept.push_back(robot.detector);
    if (robot.camera_aid.error != 0) kept.push_back(robot.camera_aid.error);
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
                     robot.localization_aid.monitor.state() != LocalizationState::kLost;
    estimate.state = robot.localization_aid.monitor.state();
    estimate.event = robot.localization_aid.event;
    estimate.correction_sigmas = robot.localization_aid.correction_sigmas;
    const PoseSources sources = sourcesOf(fleet, frame);
    estimate.used = sources.used;
    estimate.rejected = sources.rejected;
    if (estimate.valid) {
      estimate.map_from_base = fleet.pose(robot.window.back().pose);
      estimate.covariance = robot.covariance;
      estimate.datum = fleet.map_frame.datum;
      estimate.camera_error = robot.camera_aid.published;
      estimate.covariance += suspectedMove(robot);
      for (const Seen& seen : frame.seen) {
        if (seen.peer != nullptr) estimate.sightings.push_back({seen.track->id, seen.peer->setup.name});
      }
      notePublished(robot, estimate);
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
      estimate.camera_error = robot.camera_aid.published;
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
  revisePublished(fleet, true);
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

std::optional<FleetEstimator::Relation> FleetEstimator::adoptPath(const std::string& robot,
                                                                  const FleetEstimator& own) {
  RobotNode& node = impl_->node(robot);
  const RobotNode& theirs = own.impl_->node(robot);
  if (!node.located() || !theirs.located()) return std::nullopt;
  const Pose2 base_from_own = own.impl_->fleet.pose(theirs.window.back().pose).inverse();
  const Pose2 map_from_own = impl_->fleet.pose(node.window.back().pose) * base_from_own;
  estimation::adoptPath(impl_->fleet, node, own.impl_->fleet, map_from_own);
  // Errors of both poses are right perturbations at base_link, and independent.
  return Relation{map_from_own, composeCovariance(node.covariance + theirs.covariance, base_from_own,
                                                  Eigen::Matrix3d::Zero())};
}

const KeyframeMap& FleetEstimator::keyframes() const {
  return impl_->fleet.keyframes;
}

std::vector<const PlaceMemory*> FleetEstimator::placeMemories() const {
  std::vector<const PlaceMemory*> memories;
  for (const RobotNode& robot : impl_->fleet.robots) memories.push_back(&robot.place_aid.memory);
  return memories;
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
    for (const std::uint32_t index : robot.place_aid.memory.takeChanged())
      changed.push_back(robot.place_aid.memory.places()[index]);
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
  return impl_->fleet.graph.value(impl_->node(robot).wheel_aid.model);
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
  return impl_->node(robot).camera_aid.covariance;
}

const RobotStatus& FleetEstimator::status(const std::string& robot) const {
  return impl_->node(robot).status;
}

}  // namespace omnifleet::estimation
