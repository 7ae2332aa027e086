#include "estimation/fleet_state.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <stdexcept>
#include <utility>

#include "estimation/factors.h"
#include "estimation/map_frame.h"
#include "estimation/messages.h"
#include "geometry/twist.h"

namespace omnifleet::estimation {
namespace {
constexpr double kFloorCauchy = 2.0;  // σ at which a motion by the floor counts half beside wheels
constexpr double kSecond_ns = 1e9;
constexpr double kTurnSigma_rad = 0.2;           // of a landmark's frame: free, but held where it is round
constexpr double kSizeSigma = 0.1;               // 1, of a landmark's size: as free
constexpr int kMovedAfter = 5;                   // misfits in a row after which a landmark has moved away
constexpr TimeNs kExtrapolation_ns = 500000000;  // how far a robot's last motion is trusted
// Of a camera's error that was found before: what cameras' views have in common, twice; contours not at all.
const CameraError kFound = (CameraError() << 0.001, 0.002, 0.0007, 0.0007, 1.0).finished();
const Eigen::VectorXd kWhole = Eigen::VectorXd::Ones(1);  // a size that is as it was said to be
}  // namespace

AbsoluteFix AbsoluteFix::fuse(const AbsoluteFix& a, const AbsoluteFix& b) {
  const Eigen::Vector3d off = (a.map_from_base.inverse() * b.map_from_base).vector();
  const Eigen::Matrix3d gain = a.covariance * (a.covariance + b.covariance).inverse();
  return {a.map_from_base * Pose2::fromVector(gain * off),
          (Eigen::Matrix3d::Identity() - gain) * a.covariance};
}

Eigen::Matrix3d bodyCovariance(const Eigen::Matrix3d& map_covariance, double theta_rad) {
  Eigen::Matrix3d base_from_map = Eigen::Matrix3d::Identity();
  base_from_map.topLeftCorner<2, 2>() = Eigen::Rotation2Dd(-theta_rad).toRotationMatrix();
  return base_from_map * map_covariance * base_from_map.transpose();
}

FleetState::FleetState(std::vector<RobotSetup> setups, const EstimatorOptions& o)
    : options(o),
      keyframes(o.keyframes, o.match),
      recognition(o.places),
      loops(o.loops, o.match, o.keyframes) {
  for (auto& setup : setups) {
    RobotNode robot;
    robot.body = std::make_shared<const Body>(setup.body);
    robot.setup = std::move(setup);
    robot.localization_aid.relocalizer.emplace(options.relocalizer, options.match);
    robot.scan_aid.odometry = OdometryQuality(options.odometry);
    robot.floor = FloorSource(options.floor);
    robot.appearance_aid.length = DifferenceScale(options.appearance);
    robot.appearance_aid.compass = CompassQuality(options.appearance.quality);
    robot.camera_aid.published = robot.setup.camera_error;
    robot.camera_aid.covariance = options.camera.sigma().cwiseAbs2().asDiagonal();
    robot.wheel_aid.model = graph.addVariable(WheelModel::Zero());
    // Turn and delay are nobody's unless the estimator itself integrates the wheels (addWheels).
    const WheelModel sigma(options.wheel_bias_sigma, options.wheel_bias_sigma, 1e-3, 1e-3, 1e-3);
    robot.wheel_aid.prior = graph.addFactor(priorFactor(WheelModel::Zero(), sigma), {robot.wheel_aid.model});
    robot.status.message = notLocalizedYet();
    robots.push_back(std::move(robot));
  }
}

RobotNode* FleetState::find(const std::string& name) {
  return const_cast<RobotNode*>(static_cast<const FleetState*>(this)->find(name));
}

const RobotNode* FleetState::find(const std::string& name) const {
  const auto at =
      std::find_if(robots.begin(), robots.end(), [&](const auto& r) { return r.setup.name == name; });
  return at == robots.end() ? nullptr : &*at;
}

void FleetState::addWheels(RobotNode& robot, TimeNs time_ns, double left_mps, double right_mps) {
  if (!robot.wheel_aid.log) {
    const WheelLogOptions& o = options.wheel_log;
    robot.wheel_aid.log.emplace(o);
    robot.wheel_aid.delay_sigma_s = o.delay_sigma_s;
    graph.removeFactor(robot.wheel_aid.prior);
    const WheelModel sigma(o.scale_sigma, o.scale_sigma, o.turn_sigma, o.delay_sigma_s, o.crab_sigma_rad);
    robot.wheel_aid.prior = graph.addFactor(priorFactor(WheelModel::Zero(), sigma), {robot.wheel_aid.model});
  }
  robot.wheel_aid.log->add(time_ns, left_mps, right_mps);
}

void FleetState::forgetWheels() {
  constexpr TimeNs kLargestDelay_ns = 3000000000;
  for (RobotNode& robot : robots) {
    if (robot.wheel_aid.log && robot.started)
      robot.wheel_aid.log->forgetBefore(robot.last_frame_ns - kLargestDelay_ns);
  }
}

VariableId FleetState::detector(RobotNode& robot) {
  if (robot.detector != 0) return robot.detector;
  robot.detector = graph.addVariable(DetectorModel::Zero());
  // Where nothing else tells how the map is turned: surveyed points do.
  if (map_frame.start != 0) graph.setMotions(commonMotions);
  const DetectorOptions& o = options.detector;
  DetectorModel sigma;
  sigma << o.bearing_bias_sigma_rad, o.focal_sigma, o.range_scale_sigma, o.obliqueness_sigma,
      o.axis_sigma_rad, o.lag_sigma_s, o.place_sigma_m, o.place_sigma_m;
  graph.addFactor(priorFactor(DetectorModel::Zero(), sigma), {robot.detector});
  return robot.detector;
}

VariableId FleetState::camera(RobotNode& robot) {
  if (robot.camera_aid.error != 0) return robot.camera_aid.error;
  CameraError found = CameraError::Zero();
  found.head<4>() = robot.setup.camera_error;
  robot.camera_aid.error = graph.addVariable(found);
  constexpr double kNothing = 1e9;  // σ of what a prior says nothing about
  CameraError all = options.camera.sigma(), height = CameraError::Constant(kNothing);
  std::swap(all(CameraOptions::kHeight), height(CameraOptions::kHeight));
  graph.addFactor(priorFactor(CameraError::Zero(), all), {robot.camera_aid.error});
  graph.addFactor(priorFactor(CameraError::Zero(), height), {robot.camera_aid.error},
                  CameraOptions::kHeightLoss);
  if (options.camera.estimate && !found.isZero())
    graph.addFactor(priorFactor(found, kFound), {robot.camera_aid.error});
  return robot.camera_aid.error;
}

VariableId FleetState::size(RobotNode& robot) {
  if (robot.size != 0) return robot.size;
  robot.size = graph.addVariable(kWhole);
  graph.addFactor(priorFactor(kWhole, Eigen::VectorXd::Constant(1, options.body_sigma)), {robot.size});
  return robot.size;
}

CameraError FleetState::cameraError(const RobotNode& robot) const {
  return robot.camera_aid.error == 0 ? CameraError::Zero() : CameraError(graph.value(robot.camera_aid.error));
}

Step& FleetState::newStep(RobotNode& robot, Step step, const Pose2& map_from_base, const Objects& frame) {
  step.pose = graph.addVariable(map_from_base.vector());
  if (!frame.appearance.signature.bytes.empty())
    step.appearance = std::make_shared<const Appearance>(frame.appearance);
  const Pose2 since_key = robot.last_key.inverse() * map_from_base;
  step.keyframe =
      robot.last_key_ns == 0 || since_key.translation().norm() >= options.keyframe_distance_m ||
      std::abs(since_key.theta_rad) >= options.keyframe_angle_rad ||
      static_cast<double>(frame.acquired_ns - robot.last_key_ns) >= options.keyframe_time_s * kSecond_ns;
  if (step.keyframe) {
    robot.last_key = map_from_base;
    robot.last_key_ns = frame.acquired_ns;
  }
  robot.window.push_back(std::move(step));
  return robot.window.back();
}

void FleetState::advance(RobotNode& robot, const Objects& frame) {
  Step step = predictStep(robot, frame);
  const VariableId previous = robot.window.back().pose;
  const Eigen::Vector3d increment = step.by_model * (graph.value(robot.wheel_aid.model) - step.model);
  const Pose2 measured = step.previous_from_current;
  step.measured = measured;
  step.previous_from_current = measured * Pose2{increment.x(), increment.y(), increment.z()};
  Eigen::Matrix3d covariance =
      composeCovariance(robot.covariance, step.previous_from_current, step.motion_covariance);
  robot.covariance = covariance;
  robot.scan_aid.relative_covariance = composeCovariance(robot.scan_aid.relative_covariance,
                                                         step.previous_from_current, step.motion_covariance);
  const Pose2 predicted = pose(previous) * step.previous_from_current;
  const TimeNs since_ns = step.since_ns;
  Step& added = newStep(robot, std::move(step), predicted, frame);
  // Unwrapped: angles in the graph run on.
  Eigen::VectorXd& value = graph.value(added.pose);
  value(2) = graph.value(previous)(2) + added.previous_from_current.theta_rad;
  added.motion = graph.addFactor(motionFactor(measured, added.motion_covariance, added.by_model, added.model),
                                 {previous, added.pose, robot.wheel_aid.model});
  if (added.wheels && !added.wheels_rejected && added.floor && robot.floor.isConfirmed()) {
    const Eigen::Matrix3d of_floor =
        robot.floor.quality().scaled(added.floor->covariance) + 2.0 * robot.floor.quality().jitter();
    graph.addFactor(relativePoseFactor(added.floor->previous_from_current, of_floor), {previous, added.pose},
                    kFloorCauchy);
  }
  const Appearance& seen = frame.appearance;
  if (seen.since_ns == since_ns) added.difference = seen.difference;
  if (hasTurn(seen, since_ns, options.appearance))
    added.compass = CompassTurn{seen.turn_rad, options.appearance.sigma_factor * seen.turn_sigma_rad};
  // Without wheels the turn of the compass is in the motion already.
  if (!added.wheels || !options.appearance.with_wheels || !added.compass) return;
  constexpr double kOpen_m2 = 1e6;  // a compass says nothing about places
  const double sigma_rad = robot.appearance_aid.compass.scale() * added.compass->sigma_rad;
  const Eigen::Matrix3d of_turn = Eigen::Vector3d(kOpen_m2, kOpen_m2, sigma_rad * sigma_rad).asDiagonal();
  graph.addFactor(relativePoseFactor({0.0, 0.0, added.compass->turn_rad}, of_turn), {previous, added.pose},
                  options.appearance.robust_sigmas);
}

void FleetState::place(RobotNode& robot, const Objects& frame, const Pose2& map_from_base) {
  robot.window.clear();
  robot.last_key_ns = 0;
  robot.scout.reset();
  robot.absolute_aid.refusals = 0;
  robot.track_aid.unobserved = 0;
  robot.absolute_aid.refused.clear();
  ScanSource::forget(robot);
  newStep(robot, predictStep(robot, frame), map_from_base, frame);
  robot.status.state = RobotState::kOk;
  robot.status.message = {};
}

void FleetState::release(RobotNode& robot) {
  std::vector<VariableId> gone;
  for (const Step& step : robot.window) {
    for (const ViewLink& link : step.views) graph.removeFactor(link.factor);
    if (step.scan.factor != kNoFactor) graph.removeFactor(step.scan.factor);
    gone.push_back(step.pose);
  }
  robot.window.clear();
  robot.track_aid.known.clear();
  robot.track_aid.suspects.clear();
  robot.absolute_aid.disagreements = 0;
  robot.doubt.displaced = false;
  if (!gone.empty()) graph.marginalise(gone);
}

std::optional<PoseAt> FleetState::poseAt(const RobotNode& robot, TimeNs time_ns) const {
  if (!robot.located() || robot.window.front().since_ns > time_ns) return std::nullopt;
  const Step& last = robot.window.back();
  if (time_ns > last.time_ns + kExtrapolation_ns) return std::nullopt;
  auto at = std::find_if(robot.window.begin(), robot.window.end(),
                         [&](const Step& step) { return step.time_ns >= time_ns; });
  PoseAt result;
  result.extrapolated = at == robot.window.end();
  const Step& step = result.extrapolated ? last : *at;
  result.pose = step.pose;
  const double span = static_cast<double>(step.time_ns - step.since_ns);
  if (span > 0 && time_ns != step.time_ns) {
    result.offset =
        fractionOf(step.previous_from_current, static_cast<double>(time_ns - step.time_ns) / span);
  }
  result.map_from_base = pose(step.pose) * result.offset;
  return result;
}

Eigen::Vector3d FleetState::twistAt(const RobotNode& robot, TimeNs time_ns) const {
  constexpr TimeNs kSpan_ns = 200000000;
  WheelLog::Motion motion;
  if (robot.wheel_aid.log &&
      robot.wheel_aid.log->between(time_ns - kSpan_ns, time_ns, robot.setup.body.wheel_separation_m,
                                   graph.value(robot.wheel_aid.model), 0.0, motion))
    return motion.previous_from_current.vector() * (kSecond_ns / static_cast<double>(kSpan_ns));
  if (!robot.located()) return Eigen::Vector3d::Zero();
  const auto at = std::find_if(robot.window.begin(), std::prev(robot.window.end()),
                               [&](const Step& step) { return step.time_ns >= time_ns; });
  const auto span = static_cast<double>(at->time_ns - at->since_ns);
  return at->motion == kNoFactor || span <= 0
             ? Eigen::Vector3d::Zero()
             : Eigen::Vector3d(at->previous_from_current.vector() * (kSecond_ns / span));
}

Eigen::Vector2d FleetState::seenFrom(const RobotNode& robot, TimeNs time_ns,
                                     const Eigen::Vector2d& range_bearing) const {
  if (robot.detector == 0) return seenAt(range_bearing, DetectorModel::Zero());
  return seenAt(range_bearing, graph.value(robot.detector), twistAt(robot, time_ns));
}

Landmark& FleetState::addLandmark(const Eigen::Vector2d& anchor_m, double height_m, double height_sigma_m) {
  Landmark landmark;
  landmark.id = next_landmark_++;
  landmark.variable = graph.addVariable(Eigen::Vector4d(anchor_m.x(), anchor_m.y(), height_m, 0.0));
  Eigen::MatrixXd s = Eigen::MatrixXd::Zero(2, 4);
  s(0, 2) = 1.0 / height_sigma_m;
  s(1, 3) = 1.0 / kTurnSigma_rad;
  graph.addFactor(std::make_unique<DensePrior>(s, Eigen::VectorXd::Zero(2),
                                               std::vector<Eigen::VectorXd>{graph.value(landmark.variable)}),
                  {landmark.variable});
  landmark.size = graph.addVariable(kWhole);
  graph.addFactor(priorFactor(kWhole, Eigen::VectorXd::Constant(1, kSizeSigma)), {landmark.size});
  return landmarks.emplace(landmark.id, std::move(landmark)).first->second;
}

void FleetState::removeLandmark(std::uint32_t id) {
  const VariableId variable = landmarks.at(id).variable, size = landmarks.at(id).size;
  for (RobotNode& robot : robots) {
    for (Step& step : robot.window) {
      const auto of_it = [&](const ViewLink& link) { return link.landmark == id; };
      for (const ViewLink& link : step.views) {
        if (of_it(link)) graph.removeFactor(link.factor);
      }
      step.views.erase(std::remove_if(step.views.begin(), step.views.end(), of_it), step.views.end());
    }
    for (auto at = robot.track_aid.known.begin(); at != robot.track_aid.known.end();) {
      at = at->second.landmark == id ? robot.track_aid.known.erase(at) : std::next(at);
    }
  }
  graph.marginalise({variable, size});
  landmarks.erase(id);
}

void FleetState::mergeDuplicates() {
  constexpr double kSame_m = 0.06, kTie_m = 0.01;
  for (auto older = landmarks.begin(); older != landmarks.end(); ++older) {
    for (auto younger = std::next(older); younger != landmarks.end();) {
      const Landmark &a = older->second, &b = younger->second;
      const Eigen::Vector2d apart = centre(b) - centre(a);
      const double sigma = std::sqrt(a.covariance(2, 2) + b.covariance(2, 2));
      if (apart.norm() > kSame_m || std::abs(height(a) - height(b)) > 0.02 + 3.0 * sigma) {
        ++younger;
        continue;
      }
      // Between the origins when the centres agree.
      const Eigen::Vector2d offset =
          mapFromLandmark(b).translation() - mapFromLandmark(a).translation() - apart;
      Eigen::MatrixXd s = Eigen::MatrixXd::Zero(2, 8);
      s.leftCols<2>() = -Eigen::Matrix2d::Identity() / kTie_m;
      s.block<2, 2>(0, 4) = Eigen::Matrix2d::Identity() / kTie_m;
      Eigen::Vector4d at = graph.value(a.variable);
      at.head<2>() += offset;
      graph.addFactor(std::make_unique<DensePrior>(s, Eigen::VectorXd::Zero(2),
                                                   std::vector<Eigen::VectorXd>{graph.value(a.variable), at}),
                      {a.variable, b.variable});
      const std::uint32_t gone = younger->first;
      ++younger;
      removeLandmark(gone);
    }
  }
}

void FleetState::forgetLandmarks() {
  std::vector<std::uint32_t> gone;
  for (const auto& [id, landmark] : landmarks) {
    if (landmark.misfits >= kMovedAfter) gone.push_back(id);
  }
  for (std::uint32_t id : gone) removeLandmark(id);
  mergeDuplicates();
  forgetPoints();
  while (static_cast<int>(landmarks.size()) > options.max_landmarks) {
    const auto oldest = std::min_element(
        landmarks.begin(), landmarks.end(),
        [](const auto& a, const auto& b) { return a.second.last_seen_ns < b.second.last_seen_ns; });
    removeLandmark(oldest->first);
  }
}

void FleetState::forgetPoints() {
  while (static_cast<int>(points.size()) > options.max_landmarks) {
    auto oldest = points.end();
    for (auto at = points.begin(); at != points.end(); ++at) {
      if (at->second.surveyed) continue;
      if (oldest == points.end() || at->second.last_seen_ns < oldest->second.last_seen_ns) oldest = at;
    }
    if (oldest == points.end()) return;
    graph.marginalise({oldest->second.variable});
    points.erase(oldest);
  }
}

Pose2 FleetState::mapFromLandmark(const Landmark& landmark) const {
  const Eigen::VectorXd& value = graph.value(landmark.variable);
  return {value(0), value(1), value(3)};
}

Eigen::Vector2d FleetState::centre(const Landmark& landmark) const {
  Eigen::Vector2d at, by_height;
  landmark.shape->centre(at, by_height);
  return mapFromLandmark(landmark) * Eigen::Vector2d(at - height(landmark) * by_height);
}

void FleetState::addViewFactor(RobotNode& observer, ViewLink link, std::unique_ptr<PrismFactor> cost) {
  link.cost = cost.get();
  link.camera = camera(observer);
  link.factor = graph.addFactor(std::move(cost), {link.observer, link.object, link.camera, link.size});
  observer.window.back().views.push_back(std::move(link));
}

void FleetState::dropViews(Step& step) {
  for (const ViewLink& link : step.views) graph.removeFactor(link.factor);
  step.views.clear();
}

void FleetState::shareKeyframes(TimeNs time_ns) {
  const auto newest = [&](const RobotNode& r) { return r.located() && r.window.back().time_ns == time_ns; };
  const bool any = std::any_of(robots.begin(), robots.end(),
                               [&](const RobotNode& r) { return newest(r) && r.window.back().keyframe; });
  for (RobotNode& robot : robots) {
    if (!any || !newest(robot)) continue;
    robot.window.back().keyframe = true;
    robot.last_key = pose(robot.window.back().pose);
    robot.last_key_ns = time_ns;
  }
}

void FleetState::loosen(RobotNode& robot, const Eigen::Matrix3d& covariance) {
  loosen(robot, robot.window.size() - 1, covariance);
}

void FleetState::loosen(RobotNode& robot, std::size_t at, const Eigen::Matrix3d& covariance) {
  Step& step = robot.window[at];
  graph.removeFactor(step.motion);
  step.motion_covariance = covariance;
  step.motion = graph.addFactor(motionFactor(step.measured, covariance, step.by_model, step.model),
                                {robot.window[at - 1].pose, step.pose, robot.wheel_aid.model});
}

void FleetState::disbelieveWheels(RobotNode& robot) {
  for (std::size_t i = 1; i < robot.window.size(); ++i) {
    Step& step = robot.window[i];
    if (!step.wheels || step.motion == kNoFactor) continue;
    loosen(robot, i, unknownMotion(static_cast<double>(step.time_ns - step.since_ns) / kSecond_ns));
    step.wheels = false;
  }
  // Else it would go on as they had it.
  if (robot.located()) robot.window.back().previous_from_current = Pose2{};
}

void FleetState::updateShapes() {
  for (auto& [id, landmark] : landmarks) landmark.shape->begin(size(landmark));
  for (const RobotNode& robot : robots) {
    for (const Step& step : robot.window) {
      if (!step.keyframe) continue;
      for (const ViewLink& link : step.views) {
        if (link.landmark == 0) continue;
        Landmark& landmark = landmarks.at(link.landmark);
        landmark.shape->add(*link.view, mapFromLandmark(landmark).inverse() * pose(step.pose),
                            height(landmark));
      }
    }
  }
  for (auto& [id, landmark] : landmarks) landmark.shape->finish();
}

void FleetState::freezeViews(const Step& step) {
  for (const ViewLink& link : step.views) {
    if (link.landmark == 0) continue;
    Landmark& landmark = landmarks.at(link.landmark);
    landmark.shape->freeze(*link.view, mapFromLandmark(landmark).inverse() * pose(step.pose),
                           height(landmark), size(landmark));
  }
}

/// The scan of a frame that leaves the window says nothing new as long as later scans hold the window to the
/// keyframes. Without them it is the last that did.
void FleetState::dropScan(RobotNode& robot) {
  const Step& front = robot.window.front();
  const bool held = std::any_of(std::next(robot.window.begin()), robot.window.end(),
                                [](const Step& step) { return step.scan.factor != kNoFactor; });
  if (held && front.scan.factor != kNoFactor) graph.removeFactor(front.scan.factor);
}

void FleetState::slide() {
  std::vector<VariableId> gone;
  for (RobotNode& robot : robots) {
    while (static_cast<int>(robot.window.size()) > options.window_frames) {
      freezeViews(robot.window.front());
      dropScan(robot);
      gone.push_back(robot.window.front().pose);
      robot.window.pop_front();
      robot.window.front().motion = kNoFactor;
    }
  }
  if (!gone.empty()) graph.marginalise(gone);
}

std::vector<LandmarkEstimate> FleetState::landmarkEstimates() const {
  std::vector<LandmarkEstimate> all;
  for (const auto& [id, landmark] : landmarks) {
    if (landmark.views < options.publish_views) continue;
    LandmarkEstimate e;
    e.id = id;
    e.centre_m = centre(landmark);
    const Eigen::MatrixXd covariance = graph.covariance({landmark.variable});
    e.covariance = covariance.topLeftCorner<2, 2>();
    e.height_m = height(landmark);
    e.height_sigma_m = std::sqrt(covariance(2, 2));
    const Pose2 frame = mapFromLandmark(landmark);
    const Eigen::Vector2d shift = frame.translation() - e.centre_m;
    const TurnedGrid corners(-frame.theta_rad, Shape::kDirections, Shape::kDirections);
    for (int m = 0; m < Shape::kDirections; ++m) {
      const double phi = 2.0 * M_PI * m / Shape::kDirections;
      const Corner c = corners.at(m);
      e.support_m.push_back(c.wi * landmark.shape->support(c.i, e.height_m) +
                            c.wj * landmark.shape->support(c.j, e.height_m) +
                            shift.dot(Eigen::Vector2d(std::cos(phi), std::sin(phi))));
    }
    e.views = landmark.views;
    for (const auto& [observer, what] : landmark.observers) e.observers.push_back(observer);
    all.push_back(std::move(e));
  }
  return all;
}

}  // namespace omnifleet::estimation
