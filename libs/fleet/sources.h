#pragma once

#include <string>

#include "fleet/fleet.h"

namespace omnifleet::fleet {

/// Adds robots, cameras and markers of the recording `fleet.dataset`.
void addDataset(Fleet& fleet);

/// Adds robots, cameras and markers of the arena file `fleet.arena`.
void addArena(Fleet& fleet);

/// A fisheye camera must be above the floor. Throws options::Error that names the sensor file otherwise.
void requireAboveFloor(const CameraSpec& camera, const std::string& sensor_file);

}  // namespace omnifleet::fleet
