#include "common/fleet_network.h"

namespace omnifleet::services {

bus::HostNetwork networkOf(const fleet::Fleet& fleet, const bus::NetworkRequest& given) {
  bus::NetworkRequest request = given;
  if (request.interfaces.empty()) {
    request.interfaces = fleet.network.interfaces;
    request.is_shared = true;
  }
  if (request.peers.empty()) request.peers = fleet.network.peers;
  return bus::resolve(request);
}

}  // namespace omnifleet::services
