#include "bus/network.h"

#include <arpa/inet.h>
#include <fmt/format.h>
#include <netdb.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>
#include <optional>

#include "options/options.h"

namespace omnifleet::bus {
namespace {

// Each process asks every possible process of each peer one by one: 7 processes × 24 ports × 350 bytes per
// announcement are 20 kB/s to each peer.
constexpr std::chrono::seconds kLeaseOfPeers{10}, kAnnouncementToPeers{3};

// An IPv4 packet of an Ethernet frame, less than with the usual tunnels. A larger datagram is lost as a whole
// with any of its fragments.
constexpr std::uint32_t kBetweenHosts_bytes = 1400, kWithinHost_bytes = 65000;

std::optional<std::uint32_t> ipv4(const std::string& text) {
  in_addr address{};
  if (::inet_pton(AF_INET, text.c_str(), &address) != 1) return std::nullopt;
  return ntohl(address.s_addr);
}

/// A subnet "a.b.c.d/n"; an address or an interface contains only itself.
bool isIn(const std::string& wanted, const NetworkAddress& known) {
  const auto slash = wanted.find('/');
  if (slash == std::string::npos) return wanted == known.interface || wanted == known.address;
  const auto net = ipv4(wanted.substr(0, slash)), address = ipv4(known.address);
  int bits = -1;
  try {
    bits = std::stoi(wanted.substr(slash + 1));
  } catch (const std::exception&) {
  }
  if (!net || !address || bits < 1 || bits > 32) return false;
  return (*net ^ *address) >> (32 - bits) == 0;
}

std::vector<std::string> addressesOf(const NetworkRequest& request,
                                     const std::vector<NetworkAddress>& present) {
  std::vector<std::string> addresses;
  for (const std::string& wanted : request.interfaces) {
    const std::size_t before = addresses.size();
    for (const NetworkAddress& known : present) {
      if (isIn(wanted, known)) addresses.push_back(known.address);
    }
    if (addresses.size() == before && !request.is_shared)
      throw options::Error(fmt::format("interface {}: this machine has no such interface or address; {}",
                                       wanted, listed(present)));
  }
  if (addresses.empty())
    throw options::Error(fmt::format("network: this machine has none of {}; {}",
                                     fmt::join(request.interfaces, ", "), listed(present)));
  std::sort(addresses.begin(), addresses.end());
  addresses.erase(std::unique(addresses.begin(), addresses.end()), addresses.end());
  return addresses;
}

std::string peerAddress(const std::string& peer) {
  addrinfo wanted{};
  wanted.ai_family = AF_INET;
  wanted.ai_socktype = SOCK_DGRAM;
  addrinfo* found = nullptr;
  const int problem = ::getaddrinfo(peer.c_str(), nullptr, &wanted, &found);
  const std::unique_ptr<addrinfo, decltype(&::freeaddrinfo)> owner(problem == 0 ? found : nullptr,
                                                                   &::freeaddrinfo);
  if (problem != 0)
    throw options::Error(
        fmt::format("network: peer '{}' has no IPv4 address: {}; give its address, or add it to "
                    "/etc/hosts",
                    peer, ::gai_strerror(problem)));
  char text[INET_ADDRSTRLEN] = {};
  ::inet_ntop(AF_INET, &reinterpret_cast<const sockaddr_in*>(owner->ai_addr)->sin_addr, text, sizeof text);
  return text;
}

}  // namespace

bool HostNetwork::leavesHost() const {
  return std::any_of(addresses.begin(), addresses.end(),
                     [](const std::string& address) { return !isLoopback(address); });
}

void HostNetwork::apply(DdsBusOptions& options) const {
  options.interfaces = addresses;
  options.peers = peers;
  options.max_message_bytes = max_message_bytes;
  if (peers.empty()) return;
  options.lease = kLeaseOfPeers;
  options.announcement = kAnnouncementToPeers;
}

std::vector<std::string> HostNetwork::arguments() const {
  std::vector<std::string> words;
  for (const std::string& address : addresses) words.insert(words.end(), {"--interface", address});
  for (const std::string& peer : peers) words.insert(words.end(), {"--peer", peer});
  words.insert(words.end(), {"--max-message-bytes", std::to_string(max_message_bytes)});
  return words;
}

HostNetwork resolve(const NetworkRequest& request, const std::vector<NetworkAddress>& present) {
  HostNetwork network;
  if (!request.interfaces.empty()) network.addresses = addressesOf(request, present);
  checkAddresses(network.addresses, present);
  checkAddresses({"127.0.0.1"}, present);  // the processes of one host use it whatever the network does
  for (const std::string& peer : request.peers) {
    const std::string address = peerAddress(peer);
    const bool is_own = std::any_of(present.begin(), present.end(),
                                    [&](const NetworkAddress& known) { return known.address == address; });
    if (!is_own) network.peers.push_back(address);
  }
  if (!network.peers.empty() && !network.leavesHost())
    throw options::Error(
        fmt::format("network: peers are given, but only the loopback interface is used; give an interface as "
                    "well; {}",
                    listed(present)));
  network.max_message_bytes = request.max_message_bytes > 0
                                  ? static_cast<std::uint32_t>(request.max_message_bytes)
                                  : (network.leavesHost() ? kBetweenHosts_bytes : kWithinHost_bytes);
  return network;
}

HostNetwork resolve(const NetworkRequest& request) {
  return resolve(request, networkAddresses());
}

void addNetworkOptions(CLI::App& app, NetworkRequest& request) {
  app.add_option("--interface", request.interfaces,
                 "interface, address or subnet (wlan0, 192.168.1.10, 192.168.1.0/24) to reach other hosts; "
                 "repeatable; default: that of the fleet file, else loopback only")
      ->allow_extra_args(false);
  app.add_option("--peer", request.peers,
                 "name or address of another host, for networks without multicast; repeatable")
      ->allow_extra_args(false);
}

}  // namespace omnifleet::bus
