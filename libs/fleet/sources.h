#pragma once

#include <string>

#include "fleet/fleet.h"

namespace omnifleet::fleet {

/// Robots, cameras and markers of the recording `fleet.dataset`.
void addDataset(Fleet& fleet);

/// Robots, cameras and markers of the arena file `fleet.arena`.
void addArena(Fleet& fleet);

/// A fisheye camera looks at the floor from above. Throws options::Error naming the sensor file where not.
void requireAboveFloor(const CameraSpec& camera, const std::string& sensor_file);

}  // namespace omnifleet::fleet
