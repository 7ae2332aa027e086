#pragma once

#include "observation/observation.h"

namespace omnifleet::laser {

/// A laser beside the camera: its echoes take the place of the camera's rays. A ray of the camera gets the
/// range and σ of the nearest echo in its bearing about the camera's foot, and keeps its object where the
/// camera saw one there (within 0.15 m); the camera's objects stay as they are. Where the camera saw floor
/// and the laser an echo nearer than that floor ends, something thin or floor-coloured stands there:
/// kUnknown. Beyond the camera's floor walls are kObstacle, other things kUnknown; rays without echo stay the
/// camera's.
/// @param by_laser the laser's own local map of the same moment, same base_link; changes nothing unless kOk
void join(const LocalMap& by_laser, Scan& camera);

}  // namespace omnifleet::laser
