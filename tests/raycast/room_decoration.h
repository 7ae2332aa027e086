#pragma once

#include "tests/raycast/furnished_room.h"

namespace omnifleet::raycast {

/// Skirting boards, doors, radiators, curtains, glazed doors, pin boards and sockets on the inside of the
/// walls. The longest walls get a door each.
void decorateWalls(House& house, Random& random);

/// Books in shelves, doors of cupboards, drawers of chests, cushions of sofas.
void decorateFurniture(House& house, Random& random);

}  // namespace omnifleet::raycast
