#include "bus/interfaces.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <ifaddrs.h>
#include <net/if.h>
#include <netinet/in.h>

#include <algorithm>
#include <cerrno>
#include <memory>
#include <system_error>

#include "options/options.h"

namespace omnifleet::bus {
namespace {

void checkAddress(const std::string& address, const std::vector<NetworkAddress>& present) {
  const auto of_address = [&](const NetworkAddress& known) { return known.address == address; };
  const auto found = std::find_if(present.begin(), present.end(), of_address);
  const bool has_loopback = std::any_of(present.begin(), present.end(), [](const NetworkAddress& known) {
    return known.up && isLoopback(known.address);
  });
  if (isLoopback(address) && !has_loopback)
    throw options::Error(fmt::format(
        "network address {}: the loopback interface is down, so the processes of a fleet cannot reach each "
        "other; switch it on: ip link set lo up",
        address));
  if (found == present.end())
    throw options::Error(
        fmt::format("network address {}: no interface of this machine has it; {}", address, listed(present)));
  if (!std::any_of(found, present.end(),
                   [&](const NetworkAddress& known) { return of_address(known) && known.up; }))
    throw options::Error(
        fmt::format("network address {}: its interface {} is down; switch it on: ip link set {} up", address,
                    found->interface, found->interface));
  if (!std::any_of(found, present.end(),
                   [&](const NetworkAddress& known) { return of_address(known) && known.connected; }))
    throw options::Error(
        fmt::format("network address {}: its interface {} is not connected; plug in the cable or wait for "
                    "the Wi-Fi network",
                    address, found->interface));
}

}  // namespace

std::string listed(const std::vector<NetworkAddress>& present) {
  if (present.empty()) return "this machine has no address";
  std::vector<std::string> names;
  for (const NetworkAddress& known : present)
    names.push_back(fmt::format("{} ({}{})", known.address, known.interface,
                                !known.up          ? ", down"
                                : !known.connected ? ", not connected"
                                                   : ""));
  return fmt::format("this machine has {}", fmt::join(names, ", "));
}

bool isLoopback(const std::string& address) {
  return address.rfind("127.", 0) == 0;
}

std::vector<NetworkAddress> networkAddresses() {
  ifaddrs* first = nullptr;
  if (::getifaddrs(&first) != 0) throw std::system_error(errno, std::generic_category(), "getifaddrs");
  const std::unique_ptr<ifaddrs, decltype(&::freeifaddrs)> owner(first, &::freeifaddrs);
  std::vector<NetworkAddress> present;
  for (const ifaddrs* entry = first; entry != nullptr; entry = entry->ifa_next) {
    if (entry->ifa_addr == nullptr || entry->ifa_addr->sa_family != AF_INET) continue;
    char text[INET_ADDRSTRLEN] = {};
    ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(entry->ifa_addr)->sin_addr, text, sizeof text);
    present.push_back(
        {entry->ifa_name, text, (entry->ifa_flags & IFF_UP) != 0, (entry->ifa_flags & IFF_RUNNING) != 0});
  }
  return present;
}

void checkAddresses(const std::vector<std::string>& addresses, const std::vector<NetworkAddress>& present) {
  for (const std::string& address : addresses) checkAddress(address, present);
}

void requireAddresses(const std::vector<std::string>& addresses) {
  checkAddresses(addresses, networkAddresses());
}

}  // namespace omnifleet::bus
