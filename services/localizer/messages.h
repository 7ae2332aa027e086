#pragma once

#include <string>

#include "observation/error_code.h"

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

}  // namespace omnifleet::localizer
