#pragma once

#include "fleet/fleet.h"

namespace omnifleet::fleet {

/// What the wire can carry (idl/): robot and fleet names of at most 32, camera ids of at most 64 characters,
/// letters, digits, '_', '-' and '.' (a name is a DDS partition, where '*' and '?' are patterns; a camera id
/// also has its one '/'); at most 32 robots, each name once. Throws options::Error naming the file and what
/// is wrong.
void checkNames(const Fleet& fleet);

}  // namespace omnifleet::fleet
