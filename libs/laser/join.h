#pragma once

#include "observation/observation.h"

namespace omnifleet::laser {

/// Adds the echoes of a laser to the scan of the camera. A ray of the camera takes range and σ of the nearest
/// echo in its bearing about the camera's foot. It keeps its object if the camera saw one within 0.15 m of
/// the echo. If the camera's object is nearer than the echo, it is below the laser's plane, and the ray does
/// not change. On all other rays with an echo (the camera saw floor, or an object behind the echo) the ray
/// takes the laser's label, kObstacle for walls and kUnknown for other echoes, and no object: thin or
/// floor-coloured objects are found in this way. Rays without an echo, and the camera's objects, do not
/// change.
/// @param by_laser local map of the laser at the same time, in the same base_link; ignored unless kOk
void join(const LocalMap& by_laser, Scan& camera);

}  // namespace omnifleet::laser
