#pragma once

#include "observation/sources.h"

namespace omnifleet::estimation {

class FleetState;
struct RobotFrame;
struct RobotNode;

/// What the pose of a robot's newest frame rests on, and what has been rejected there. A source in neither
/// set had nothing to say. Pure; call it after the frame has been solved.
struct PoseSources {
  SourceSet used, rejected;
};
PoseSources sourcesOf(const FleetState& fleet, const RobotFrame& frame);

}  // namespace omnifleet::estimation
