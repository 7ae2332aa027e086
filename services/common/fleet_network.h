#pragma once

#include "bus/network.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// The network of a fleet on this machine: `--interface` and `--peer`, where given, take precedence over the
/// fleet file. Throws options::Error (bus::resolve).
bus::HostNetwork networkOf(const fleet::Fleet& fleet, const bus::NetworkRequest& given);

}  // namespace omnifleet::services
