#include "estimation/uncertainty.h"

#include <cmath>
#include <string>
#include <vector>

namespace omnifleet::estimation {
namespace {

constexpr double kToldAnew = 0.003;  // heights of the camera, displaced 3 of them away: told anew beyond it

/// So that the calibration can be mended: again as it becomes surer, and at the end.
void tellPeople(FleetState& fleet, RobotNode& robot, const CameraCovariance& covariance, bool settled) {
  constexpr double kSurer = 0.5;
  const double variance = covariance.diagonal().head<4>().sum();
  if (!settled && robot.camera_said > 0 && variance > kSurer * kSurer * robot.camera_said) return;
  const std::string what = tellError(fleet.cameraError(robot), covariance, fleet.options.camera);
  if (what.empty()) return;
  robot.camera_said = variance;
  fleet.findings.push_back(robot.setup.name + ": its camera's calibration minus what is seen: " + what);
}

/// Whoever maps by it maps anew when it changes, so it changes only by what is worth that, and at the end.
void tellCamera(FleetState& fleet, RobotNode& robot, const CameraCovariance& covariance, bool settled) {
  const Eigen::Vector4d now = believedError(fleet.cameraError(robot), covariance, fleet.options.camera);
  if (settled || displacement(now - robot.camera_told) > kToldAnew) robot.camera_told = now;
  if (displacement(robot.camera_told) > kToldAnew) tellPeople(fleet, robot, covariance, settled);
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
    if (robot.camera != 0) wanted.push_back(robot.camera);
  }
  for (const RobotNode& robot : fleet.robots) {
    if (robot.log) wanted.push_back(robot.wheels);
  }
  if (wanted.empty()) return;
  const Eigen::MatrixXd covariance =
      whole ? fleet.graph.covariance(wanted) : fleet.graph.newestCovariance(wanted);
  Eigen::Index at = 0;
  for (RobotNode& robot : fleet.robots) {
    if (!robot.located()) continue;
    const Pose2 pose = fleet.pose(robot.window.back().pose);
    robot.covariance = bodyCovariance(covariance.block<3, 3>(at, at), pose.theta_rad);
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
    if (robot.camera == 0) continue;
    tellCamera(fleet, robot, covariance.block<kCameraErrors, kCameraErrors>(at, at), settled);
    at += kCameraErrors;
  }
  for (RobotNode& robot : fleet.robots) {
    if (!robot.log) continue;
    robot.delay_sigma_s = std::sqrt(covariance(at + kDelay, at + kDelay));
    at += WheelModel::RowsAtCompileTime;
  }
}

}  // namespace omnifleet::estimation
