#pragma once

#include "fleet/fleet.h"

namespace omnifleet::fleet {

/// Robots, cameras and markers of the recording `fleet.dataset`.
void addDataset(Fleet& fleet);

/// Robots, cameras and markers of the arena file `fleet.arena`.
void addArena(Fleet& fleet);

}  // namespace omnifleet::fleet
