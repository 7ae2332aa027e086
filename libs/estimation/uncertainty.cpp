#include "estimation/uncertainty.h"

#include <cmath>
#include <string>
#include <vector>

#include "estimation/messages.h"

namespace omnifleet::estimation {
namespace {

constexpr double kPublishAgain =
    0.003;  // heights of the camera, displacement 3 of them away, beyond which the error is published again

/// What was said and is not borne out is taken back.
void acquit(FleetState& fleet, RobotNode& robot, const CameraFinding& finding, bool settled) {
  const CameraFinding::Quantities withdrawn =
      robot.camera_aid.accused & ~(settled ? finding.wrong() : finding.possible());
  if (withdrawn.none()) return;
  robot.camera_aid.accused &= ~withdrawn;
  fleet.findings.push_back(calibrationErrorWithdrawn(robot.setup.name, CameraFinding::name(withdrawn)));
}

/// Those of which it has been so for a while: what shade and corners make of outlines changes with the way,
/// what is wrong with a camera stays wrong.
CameraFinding::Quantities lasting(RobotNode& robot, const CameraFinding& finding, bool settled) {
  constexpr int kPersistent = 15;  // keyframes: half a metre, or a turn of 45°
  CameraFinding::Quantities which;
  for (std::size_t i = 0; i < which.size(); ++i) {
    int& keyframes = robot.camera_aid.doubts[i];
    if (!finding.wrong()[i]) keyframes = 0;
    if (finding.wrong()[i] && robot.located() && robot.window.back().keyframe) ++keyframes;
    which[i] = finding.wrong()[i] && (settled || keyframes >= kPersistent);
  }
  return which;
}

/// So that the calibration can be mended: again as it becomes surer, and at the end.
void reportCameraError(FleetState& fleet, RobotNode& robot, bool settled) {
  constexpr double kSurer = 0.5;
  const CameraFinding finding(fleet.cameraError(robot), robot.camera_aid.covariance, fleet.options.camera);
  acquit(fleet, robot, finding, settled);
  const CameraFinding::Quantities wrong = lasting(robot, finding, settled);
  const double variance = robot.camera_aid.covariance.diagonal().head<4>().sum();
  const bool surer = robot.camera_aid.said <= 0 || variance <= kSurer * kSurer * robot.camera_aid.said;
  if (wrong.none() || !(settled || surer) ||
      displacement(robot.camera_aid.published, robot.setup.lens) <= kPublishAgain)
    return;
  robot.camera_aid.said = variance;
  robot.camera_aid.accused |= wrong;
  fleet.findings.push_back(calibrationError(robot.setup.name, finding.describe(wrong)));
}

/// Whoever maps by it maps anew when it changes, so it changes only by what is worth that, and at the end.
void publishCameraError(FleetState& fleet, RobotNode& robot, bool settled) {
  const Eigen::Vector4d now =
      believedError(fleet.cameraError(robot), robot.camera_aid.covariance, fleet.options.camera);
  if (settled || displacement(now - robot.camera_aid.published, robot.setup.lens) > kPublishAgain)
    robot.camera_aid.published = now;
  reportCameraError(fleet, robot, settled);
}

}  // namespace

void updateUncertainty(FleetState& fleet, bool whole, bool settled) {
  std::vector<VariableId> wanted;
  for (const RobotNode& robot : fleet.robots) {
    if (robot.located()) wanted.push_back(robot.window.back().pose);
  }
  for (const auto& [id, landmark] : fleet.landmarks) wanted.push_back(landmark.variable);
  for (const auto& [name, point] : fleet.points) wanted.push_back(point.variable);
  for (const RobotNode& robot : fleet.robots) {
    if (robot.camera_aid.error != 0) wanted.push_back(robot.camera_aid.error);
  }
  for (const RobotNode& robot : fleet.robots) {
    if (robot.wheel_aid.log) wanted.push_back(robot.wheel_aid.model);
  }
  if (wanted.empty()) return;
  const Eigen::MatrixXd covariance =
      whole ? fleet.graph.covariance(wanted) : fleet.graph.newestCovariance(wanted);
  Eigen::Index at = 0;
  for (RobotNode& robot : fleet.robots) {
    if (!robot.located()) continue;
    const Pose2 pose = fleet.pose(robot.window.back().pose);
    robot.scan_aid.relative_covariance = bodyCovariance(covariance.block<3, 3>(at, at), pose.theta_rad);
    robot.covariance = ScanSource::inMap(fleet, robot);
    at += 3;
  }
  for (auto& [id, landmark] : fleet.landmarks) {
    landmark.covariance = covariance.block<3, 3>(at, at);
    at += 4;
  }
  for (auto& [name, point] : fleet.points) {
    point.covariance = covariance.block<2, 2>(at, at);
    at += 2;
  }
  for (RobotNode& robot : fleet.robots) {
    if (robot.camera_aid.error == 0) continue;
    robot.camera_aid.covariance = covariance.block<kCameraErrors, kCameraErrors>(at, at);
    publishCameraError(fleet, robot, settled);
    at += kCameraErrors;
  }
  for (RobotNode& robot : fleet.robots) {
    if (!robot.wheel_aid.log) continue;
    robot.wheel_aid.delay_sigma_s = std::sqrt(covariance(at + kDelay, at + kDelay));
    at += WheelModel::RowsAtCompileTime;
  }
}

}  // namespace omnifleet::estimation
