#pragma once

#include <fmt/format.h>

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

/// A message of the estimator with robot, acquisition time and, if the robot is localized, its place in map.
inline Message ofRobot(const PoseEstimate& pose, const Message& message) {
  const std::string place =
      pose.valid ? fmt::format(", now at ({:.2f}, {:.2f}) m", pose.map_from_base.x_m, pose.map_from_base.y_m)
                 : "";
  return {message.code, fmt::format("{} at {:.1f} s{}: {}", pose.robot,
                                    1e-9 * static_cast<double>(pose.acquired_ns), place, message.text)};
}

}  // namespace omnifleet::localizer
