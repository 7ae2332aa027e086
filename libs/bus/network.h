#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "bus/dds_bus.h"
#include "bus/interfaces.h"

namespace CLI {
class App;
}

namespace omnifleet::bus {

/// How the processes of a fleet reach each other, as a user states it.
struct NetworkRequest {
  /// Interfaces, addresses or subnets: "wlan0", "192.168.1.10", "192.168.1.0/24". Empty: loopback only.
  std::vector<std::string> interfaces;
  /// From a file that several machines share: those that this machine has are used, the others ignored.
  bool is_shared = false;
  std::vector<std::string> peers;  ///< other hosts, for networks without multicast: names or addresses
  int max_message_bytes = 0;       ///< largest datagram; 0: 1400 between hosts, else 65000
};

/// The same for this machine.
struct HostNetwork {
  std::vector<std::string> addresses{"127.0.0.1"};  ///< IPv4, of this machine
  std::vector<std::string> peers;                   ///< IPv4, of other machines
  std::uint32_t max_message_bytes = 65000;

  bool leavesHost() const;  ///< some address is not a loopback address
  void apply(DdsBusOptions& options) const;
  /// The options of a service that state the same.
  std::vector<std::string> arguments() const;
};

/// Throws options::Error when an interface, an address or a peer does not exist or is down.
HostNetwork resolve(const NetworkRequest& request, const std::vector<NetworkAddress>& present);
HostNetwork resolve(const NetworkRequest& request);

/// --interface and --peer, the same for every program.
void addNetworkOptions(CLI::App& app, NetworkRequest& request);

}  // namespace omnifleet::bus
