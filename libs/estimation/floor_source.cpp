#include "estimation/floor_source.h"

#include <Eigen/Dense>
#include <cmath>

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {
namespace {

/// What a step is compared with: its motion or one of its poses, and its covariance (right perturbation).
struct Reference {
  Pose2 pose;
  Eigen::Matrix3d covariance;
};

/// The wheels' motion of a step, unless it is rejected.
bool byWheels(const Step& step) {
  return step.wheels && !step.wheels_rejected && !step.by_floor && !step.rejected;
}

/// A pose by its scan alone.
Reference byScan(const ScanLink& link) {
  constexpr double kUnknown = 4.0;  // 1/m², 1/rad²: of a direction that the scan leaves open
  const Eigen::Matrix3d covariance = (link.information + kUnknown * Eigen::Matrix3d::Identity()).inverse();
  return {link.map_from_keyframe * link.keyframe_from_base * Pose2::fromVector(covariance * link.gradient),
          covariance};
}

/// The newest step by what does not rest on the floor.
std::optional<Reference> referenceOf(const FleetState& fleet, const RobotNode& robot) {
  const Step &from = robot.window[robot.window.size() - 2], &to = robot.window.back();
  if (to.scan.factor != kNoFactor && from.scan.factor != kNoFactor) {
    const Reference first = byScan(from.scan), second = byScan(to.scan);
    const Pose2 moved = first.pose.inverse() * second.pose;
    return Reference{moved,
                     composeCovariance(first.covariance, moved, second.covariance + to.scan.systematic)};
  }
  if (byWheels(to)) return Reference{to.previous_from_current, to.motion_covariance};
  if (to.by_floor || robot.track_aid.unobserved != 0) return std::nullopt;
  return Reference{fleet.pose(from.pose).inverse() * fleet.pose(to.pose), robot.covariance};
}

}  // namespace

FloorSourceOptions FloorSourceOptions::read(const options::Section& section) {
  FloorSourceOptions o;
  section.read("use", o.use);
  o.quality = OdometryQualityOptions::read(section.child("quality"));
  section.finish();
  return o;
}

void FloorSource::predict(const FloorMotion& motion, const OdometryQuality& wheels, double gate_chi2,
                          Step& step) const {
  if (!options_.use || !motion.valid || motion.since_ns != step.since_ns ||
      !motion.previous_from_current.isFinite() || !motion.covariance.allFinite())
    return;
  step.floor = FloorStep{motion.previous_from_current, motion.covariance};
  if (step.wheels) {
    if (step.wheels_rejected || !isConfirmed()) return;
    const Eigen::Vector3d off =
        (motion.previous_from_current.inverse() * step.previous_from_current).vector();
    const Eigen::Matrix3d of_both = quality_.scaled(motion.covariance) + 2.0 * quality_.jitter() +
                                    wheels.scaled(step.motion_covariance) + 2.0 * wheels.jitter();
    if (!(off.dot(of_both.ldlt().solve(off)) > gate_chi2)) return;
    step.wheels_rejected = true;
    step.by_model.setZero();
  }
  step.previous_from_current = motion.previous_from_current;
  if (!isConfirmed()) return;
  step.motion_covariance = motion.covariance;
  step.by_floor = true;
  if (step.wheels) return;
  step.rolled_m = motion.previous_from_current.translation().norm();
  step.rolled_rad = std::abs(motion.previous_from_current.theta_rad);
}

void FloorSource::learn(const FleetState& fleet, const RobotNode& robot) {
  if (robot.window.size() < 2 || !robot.window.back().floor) {
    quality_.interrupt();
    return;
  }
  const FloorStep& floor = *robot.window.back().floor;
  const auto reference = referenceOf(fleet, robot);
  if (!reference) {
    quality_.interrupt();
    return;
  }
  quality_.add(floor.previous_from_current.inverse() * reference->pose, reference->covariance,
               floor.covariance, floor.previous_from_current.translation().norm());
}

}  // namespace omnifleet::estimation
