#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>

#include "observation/error_code.h"
#include "observation/observation.h"

namespace omnifleet::localizer {

inline Message restartedWithoutPose(const std::string& robot) {
  return {ErrorCode::kNotLocalized,
          robot +
              ": no replica of the map holds its pose after the restart; it has no pose until a ceiling "
              "camera or a localized robot observes it"};
}
inline Message poseGap(const std::string& robot, double gap_s, double until_s) {
  return {
      ErrorCode::kPoseGap,
      fmt::format(
          "{}: no pose for {:.1f} s before {:.1f} s: no frame of it arrived, or no localizer ran; the pose "
          "after it has event gap. Its replica may hold keyframes of that time and re-sends them",
          robot, gap_s, until_s)};
}
inline Message neverLocalized(const std::string& robot) {
  return {ErrorCode::kNotLocalized,
          robot +
              ": never localized; nothing it observed is in the map. Give it an initial_pose or let a "
              "ceiling camera or a localized robot observe it"};
}
inline Message noRobotLocalized() {
  return {
      ErrorCode::kNotLocalized,
      "no robot was ever localized, so there is no map. Give one robot an initial_pose in the fleet file, "
      "or provide a ceiling camera or surveyed landmarks"};
}

inline Message measurementTooOld(const std::string& source, const std::string& robot, double age_s) {
  return {
      ErrorCode::kMeasurementRejected,
      fmt::format("{}: its pose of {} is {:.1f} s old and is rejected; check the clock and the load of its "
                  "machine",
                  source, robot, age_s)};
}
/// @param times so often in a row they differ until the pair counts as moved
inline Message camerasDisagree(const std::string& first, const std::string& second, const std::string& robot,
                               double off_m, double off_rad, int times) {
  return {
      ErrorCode::kCamerasDisagree,
      fmt::format("{} and {}: their poses of {} differ by {:.1f} cm and {:.1f} degrees; both poses are "
                  "rejected. If they differ at {} times in a row, no pose of either camera is used, of any "
                  "robot, until they agree at {} times in a row. Measure position_m and rotation_rpy_deg of "
                  "both cameras again",
                  first, second, robot, 100.0 * off_m, off_rad * 180.0 / M_PI, times, times)};
}
/// @param decided the track of the robot says which of the markers is its own
inline Message markersAmbiguous(const std::string& camera, const std::string& robot, bool decided) {
  return {ErrorCode::kMarkersAmbiguous,
          fmt::format("camera {}: two markers have the colours of {}; {}. Remove one or change its colours",
                      camera, robot, decided ? "the one near its last pose is used" : "neither is used")};
}
/// A robot without an initial pose has found its place in the common map.
inline Message robotMatched(const std::string& robot, const Alignment& alignment) {
  const Pose2& at = alignment.map_from_frame;
  return {ErrorCode::kFrameMatched,
          fmt::format(
              "{} at {:.1f} s: its map matches the common map ({}); its initial pose is ({:.2f}, {:.2f}) m, "
              "{:.1f} degrees, and all it observed joins the map",
              robot, 1e-9 * static_cast<double>(alignment.acquired_ns), alignment.reason, at.x_m, at.y_m,
              at.theta_rad * 180.0 / M_PI)};
}
inline Message robotNotMatched(const std::string& robot, const Alignment& alignment) {
  return {ErrorCode::kFrameNotMatched,
          fmt::format(
              "{}: {} ({}); nothing of it is in the common map, its own map is in maps/{}. Give it an "
              "initial_pose, or let it drive where the others have been",
              robot,
              alignment.status == AlignmentStatus::kRefused ? "its map contradicts the common map"
                                                            : "its map was not matched with the common map",
              alignment.reason, robot)};
}
/// A message of the estimator with robot, acquisition time and, if the robot is localized, its place in map.
inline Message ofRobot(const PoseEstimate& pose, const Message& message) {
  const std::string place =
      pose.valid ? fmt::format(", now at ({:.2f}, {:.2f}) m", pose.map_from_base.x_m, pose.map_from_base.y_m)
                 : "";
  return {message.code, fmt::format("{} at {:.1f} s{}: {}", pose.robot,
                                    1e-9 * static_cast<double>(pose.acquired_ns), place, message.text)};
}

}  // namespace omnifleet::localizer
