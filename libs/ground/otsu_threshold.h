#pragma once

#include <array>

#include "ground/appearance_class.h"

namespace omnifleet::ground {

/// Otsu threshold (Otsu 1979) between two kinds of appearances below 1.0 of the floor's light.
/// kFloorAppearance where there is only one kind.
/// @param pixels of a region, counted by appearance
Appearance otsuThreshold(const std::array<int, 256>& pixels);

}  // namespace omnifleet::ground
