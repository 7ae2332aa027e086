#pragma once

#include <fmt/format.h>

#include "observation/error_code.h"

namespace omnifleet::formation {

inline Message commandRejected() {
  return {ErrorCode::kCommandRejected,
          "formation/command: command rejected, a number is not finite, the distance is not positive or the "
          "shape is unknown; the fleet keeps its last command"};
}
/// @param left_m from the leader to its next waypoint
inline Message goalUnreachable(double left_m) {
  return {
      ErrorCode::kGoalUnreachable,
      fmt::format("the leader finds no way to its next waypoint and stands {:.2f} m before it; send other "
                  "waypoints (scripts/command.sh)",
                  left_m)};
}

}  // namespace omnifleet::formation
