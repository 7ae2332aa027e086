#pragma once

#include <array>

#include "ground/look.h"

namespace omnifleet::ground {

/// Where looks below 1.0 of the floor's light part best in two kinds (Otsu 1979); kFloorLook where they are
/// one.
/// @param pixels of a region, by their look
Look partingOf(const std::array<int, 256>& pixels);

}  // namespace omnifleet::ground
