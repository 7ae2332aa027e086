#pragma once

#include <string>
#include <vector>

namespace omnifleet::bus {

/// One IPv4 address of this machine (of this network namespace).
struct NetworkAddress {
  std::string interface;  ///< "lo", "eth0"
  std::string address;    ///< "127.0.0.1"
  bool up = false;        ///< the interface is up
  bool connected = true;  ///< and has a carrier: a cable, or a Wi-Fi network
};

bool isLoopback(const std::string& address);  ///< 127.0.0.0/8

/// All IPv4 addresses of this machine. An interface that is down may keep its addresses; a loopback interface
/// that was never up has none. Throws std::system_error when the kernel does not list them. Source:
/// getifaddrs(3).
std::vector<NetworkAddress> networkAddresses();

/// "this machine has 127.0.0.1 (lo), 10.0.0.1 (eth0, down)", for messages.
std::string listed(const std::vector<NetworkAddress>& present);

/// Throws options::Error when one of `addresses` is not among `present`, or when its interface is down or
/// not connected. DDS would start without an error and reach no other participant.
void checkAddresses(const std::vector<std::string>& addresses, const std::vector<NetworkAddress>& present);

/// checkAddresses() with the addresses of this machine.
void requireAddresses(const std::vector<std::string>& addresses);

}  // namespace omnifleet::bus
