// Motion of a robot from frame to frame: by its wheels, by the log of its wheels, by the texture of the
// floor, or by its last velocity.
#include <algorithm>
#include <cmath>

#include "estimation/factors.h"
#include "estimation/fleet_state.h"
#include "geometry/twist.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSecond_ns = 1e9;
constexpr double kMotionFloor = 1e-8;  // m², rad²: no step is known better than 0.1 mm, 0.1 mrad

}  // namespace

/// Without wheels the compass measures the turn, and the distance of the signatures the length of the step,
/// of a robot that drives forward, or as its last step did.
void FleetState::predictByAppearance(const RobotNode& robot, const Appearance& appearance, Step& step) const {
  if (!hasTurn(appearance, step.since_ns, options.appearance)) return;
  const double sigma_rad =
      robot.appearance_aid.compass.scale() * options.appearance.sigma_factor * appearance.turn_sigma_rad;
  step.previous_from_current.theta_rad = appearance.turn_rad;
  step.motion_covariance.row(2).setZero();
  step.motion_covariance.col(2).setZero();
  step.motion_covariance(2, 2) = sigma_rad * sigma_rad;
  const auto length = robot.appearance_aid.length.lengthOf(appearance.difference, appearance.turn_rad);
  if (!length) return;
  const double sign = step.previous_from_current.x_m < 0 ? -1.0 : 1.0, half = 0.5 * appearance.turn_rad;
  const double m = sign * length->m;
  step.previous_from_current.x_m = m * std::cos(half);
  step.previous_from_current.y_m = m * std::sin(half);
  // The step may lead anywhere between both headings: the robot may have turned before or after it.
  const double aside_m = m * std::sin(half), along = length->sigma_m * length->sigma_m + aside_m * aside_m;
  if (!options.appearance.free_scale && along > step.motion_covariance(0, 0)) return;
  step.motion_covariance.topLeftCorner<2, 2>() = along * Eigen::Matrix2d::Identity();
  step.by_appearance = true;
}

Step FleetState::predictStep(const RobotNode& robot, const Objects& frame) const {
  Step step;
  step.time_ns = frame.acquired_ns;
  step.sequence = frame.sequence;
  const Step* previous = robot.located() ? &robot.window.back() : nullptr;
  const Motion& motion = frame.motion;
  step.since_ns = previous != nullptr ? previous->time_ns : motion.since_ns;
  const double separation = robot.setup.body.wheel_separation_m;
  step.wheels_rejected = motion.wheels_rejected && motion.since_ns == step.since_ns;
  step.wheels = motion.valid && (robot.wheel_aid.wiring == Wiring::kAsConfigured || step.wheels_rejected) &&
                motion.previous_from_current.isFinite() && motion.covariance.allFinite() &&
                motion.since_ns == step.since_ns;
  if (step.wheels) {
    step.previous_from_current = motion.previous_from_current;
    step.motion_covariance = motion.covariance;
    step.rolled_m = std::max(std::abs(motion.left_m), std::abs(motion.right_m));
    step.rolled_rad =
        separation > 0 ? (std::abs(motion.left_m) + std::abs(motion.right_m)) / separation : 0.0;
    if (separation > 0 && !step.wheels_rejected)
      step.by_model.leftCols<2>() = arcBiasJacobian(motion.left_m, motion.right_m, separation);
  } else if (previous != nullptr && fromLog(robot, step)) {
    step.wheels = true;
  } else if (previous != nullptr) {
    predictWithoutWheels(robot, *previous, frame, step);
  }
  if (step.wheels) robot.floor.predict(frame.floor_motion, robot.scan_aid.odometry, options.gate_chi2, step);
  step.motion_covariance.diagonal().array() += kMotionFloor;
  if (step.hasOdometry()) addOdometryErrors(robot, step);
  step.own_covariance = step.motion_covariance;
  if (frame.state != FrameState::kOk && previous != nullptr) {
    const double unseen_s = static_cast<double>(step.time_ns - step.since_ns) / kSecond_ns;
    const double m = options.carried_m, rad = options.carried_rad;
    step.motion_covariance.diagonal() +=
        options.carried_per_s * unseen_s * Eigen::Vector3d(m * m, m * m, rad * rad);
  }
  return step;
}

/// By the texture of the floor if it is confirmed. Else by what the images show; failing that the floor, or
/// the last velocity, is the mean of a motion that may be any.
void FleetState::predictWithoutWheels(const RobotNode& robot, const Step& previous, const Objects& frame,
                                      Step& step) const {
  const double dt = static_cast<double>(step.time_ns - step.since_ns) / kSecond_ns;
  const double last_dt = static_cast<double>(previous.time_ns - previous.since_ns) / kSecond_ns;
  if (previous.motion != kNoFactor && last_dt > 0)
    step.previous_from_current = fractionOf(previous.previous_from_current, std::min(dt / last_dt, 2.0));
  // Without observations a wrong speed stays wrong: σ grows with time, not with its root.
  const double longer =
      robot.scan_aid.matched || previous.isMeasured() ? 1.0 : 2.0 * robot.track_aid.unobserved + 1.0;
  step.motion_covariance = longer * unknownMotion(dt);
  robot.floor.predict(frame.floor_motion, robot.scan_aid.odometry, options.gate_chi2, step);
  if (!step.by_floor) predictByAppearance(robot, frame.appearance, step);
}

/// Adds the errors of wheels, or of the floor's texture, that other sources have shown.
void FleetState::addOdometryErrors(const RobotNode& robot, Step& step) const {
  const OdometryQuality& quality = robot.odometryOf(step);
  step.claimed_covariance = step.motion_covariance;
  step.motion_covariance = quality.scaled(step.claimed_covariance);
  step.wheel_covariance = step.motion_covariance;
  step.jitter = quality.jitter();
  if (robot.located())
    step.motion_covariance =
        composeCovariance(robot.window.back().jitter, step.previous_from_current, step.motion_covariance);
  step.motion_covariance += step.jitter;
}

Eigen::Matrix3d FleetState::unknownMotion(double over_s) const {
  const double way = options.no_wheels_sigma_mps * over_s, turn = options.no_wheels_sigma_radps * over_s;
  return Eigen::Vector3d(way * way, way * way, turn * turn).asDiagonal();
}

bool FleetState::fromLog(const RobotNode& robot, Step& step) const {
  if (!robot.wheel_aid.log) return false;
  step.model = graph.value(robot.wheel_aid.model);
  WheelLog::Motion motion;
  if (!robot.wheel_aid.log->between(step.since_ns, step.time_ns, robot.setup.body.wheel_separation_m,
                                    step.model, robot.wheel_aid.delay_sigma_s, motion))
    return false;
  step.previous_from_current = motion.previous_from_current;
  step.motion_covariance = motion.covariance;
  step.by_model = motion.jacobian;
  return true;
}

bool FleetState::motionBetween(const RobotNode& robot, TimeNs from_ns, const Objects& frame,
                               Pose2& motion) const {
  Step step;
  step.since_ns = from_ns;
  step.time_ns = frame.acquired_ns;
  const Motion& own = frame.motion;
  const bool measured = own.valid && own.since_ns == from_ns && own.previous_from_current.isFinite();
  if (!measured && !fromLog(robot, step)) return false;
  motion = measured ? own.previous_from_current : step.previous_from_current;
  return true;
}

}  // namespace omnifleet::estimation
