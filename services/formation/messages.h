#pragma once

#include <fmt/format.h>

#include <Eigen/Core>
#include <string>

#include "observation/error_code.h"

namespace omnifleet::formation {

inline Message commandRejected() {
  return {ErrorCode::kCommandRejected,
          "formation/command: command rejected, a number is not finite, a distance is not positive, or the "
          "shape or behaviour is unknown; the fleet keeps its last command"};
}
/// @param left_m from the leader to its next waypoint
inline Message goalUnreachable(double left_m) {
  return {
      ErrorCode::kGoalUnreachable,
      fmt::format("the leader finds no way to its next waypoint and stands {:.2f} m before it; send other "
                  "waypoints (scripts/command.sh)",
                  left_m)};
}
/// @param place_m of the frontier, map
inline Message frontierNotReached(const std::string& robot, const Eigen::Vector2d& place_m) {
  return {ErrorCode::kGoalUnreachable,
          fmt::format(
              "{} finds no way to the floor at ({:.2f}, {:.2f}) m, which stays unknown in the map; clear the "
              "way, or reduce formation: {{exploration: {{plan: {{margin_m}}}}}}",
              robot, place_m.x(), place_m.y())};
}

}  // namespace omnifleet::formation
