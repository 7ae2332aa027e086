#pragma once

#include "fleet/fleet.h"

namespace omnifleet::fleet {

/// Checks the limits of the wire format (idl/). Robot and fleet names have at most 32, camera ids at most 64
/// characters: letters, digits, '_', '-' and '.'. A name is a DDS partition, where '*' and '?' are patterns.
/// A camera id also contains one '/'. At most 32 robots, each name once. Throws options::Error that names the
/// file and the problem.
void checkNames(const Fleet& fleet);

}  // namespace omnifleet::fleet
