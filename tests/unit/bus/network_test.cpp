// --interface, --peer and the network of a fleet file, on a machine with known interfaces.

#include "bus/network.h"

#include <gmock/gmock.h>

#include "options/options.h"

namespace omnifleet::bus {
namespace {

using testing::AllOf;
using testing::ElementsAre;
using testing::HasSubstr;

const std::vector<NetworkAddress> kPresent{{"lo", "127.0.0.1", true},
                                           {"wlan0", "192.168.1.10", true},
                                           {"eth0", "10.0.0.4", true},
                                           {"eth0", "10.0.1.4", true},
                                           {"usb0", "172.16.0.1", false}};

NetworkRequest given(std::vector<std::string> interfaces, std::vector<std::string> peers = {}) {
  NetworkRequest request;
  request.interfaces = std::move(interfaces);
  request.peers = std::move(peers);
  return request;
}

/// Of a file that several machines share.
NetworkRequest shared(std::vector<std::string> interfaces) {
  NetworkRequest request = given(std::move(interfaces));
  request.is_shared = true;
  return request;
}

std::string problemOf(const NetworkRequest& request) {
  try {
    resolve(request, kPresent);
  } catch (const options::Error& error) {
    return error.what();
  }
  return {};
}

TEST(ResolveNetwork, UsesLoopbackWithLargeDatagramsByDefault) {
  const HostNetwork network = resolve({}, kPresent);
  EXPECT_THAT(network.addresses, ElementsAre("127.0.0.1"));
  EXPECT_FALSE(network.leavesHost());
  EXPECT_EQ(network.max_message_bytes, 65000u);
}

TEST(ResolveNetwork, TakesInterfaceAddressOrSubnet) {
  const auto addresses = [](const std::string& wanted) {
    return resolve(given({wanted}), kPresent).addresses;
  };
  EXPECT_THAT(addresses("wlan0"), ElementsAre("192.168.1.10"));
  EXPECT_THAT(addresses("eth0"), ElementsAre("10.0.0.4", "10.0.1.4"));
  EXPECT_THAT(addresses("10.0.1.4"), ElementsAre("10.0.1.4"));
  EXPECT_THAT(addresses("10.0.0.0/24"), ElementsAre("10.0.0.4"));
  EXPECT_THAT(addresses("10.0.0.0/16"), ElementsAre("10.0.0.4", "10.0.1.4"));
}

/// A larger datagram is lost as a whole with any of its fragments.
TEST(ResolveNetwork, KeepsDatagramsBetweenHostsBelowOnePacket) {
  const HostNetwork network = resolve(given({"wlan0"}), kPresent);
  EXPECT_TRUE(network.leavesHost());
  EXPECT_EQ(network.max_message_bytes, 1400u);
  NetworkRequest jumbo = given({"wlan0"});
  jumbo.max_message_bytes = 9000;
  EXPECT_EQ(resolve(jumbo, kPresent).max_message_bytes, 9000u);
}

/// One fleet file lists the addresses of all its machines.
TEST(ResolveNetwork, TakesOwnAddressesFromSharedFile) {
  EXPECT_THAT(resolve(shared({"192.168.1.10", "192.168.1.11"}), kPresent).addresses,
              ElementsAre("192.168.1.10"));
  EXPECT_THAT(problemOf(shared({"192.168.1.12", "192.168.1.11"})),
              AllOf(HasSubstr("192.168.1.12, 192.168.1.11"), HasSubstr("192.168.1.10 (wlan0)")));
  EXPECT_THAT(problemOf(given({"192.168.1.10", "192.168.1.11"})), HasSubstr("192.168.1.11"))
      << "what the user gives for this machine must exist";
}

TEST(ResolveNetwork, RefusesWhatCannotWork) {
  EXPECT_THAT(problemOf(given({"wlan1"})), AllOf(HasSubstr("wlan1"), HasSubstr("192.168.1.10 (wlan0)")));
  EXPECT_THAT(problemOf(given({"usb0"})), HasSubstr("ip link set usb0 up"));
  EXPECT_THAT(problemOf(given({}, {"192.168.1.11"})), HasSubstr("give an interface"));
  EXPECT_THAT(problemOf(given({"wlan0"}, {"no.such.host.invalid"})), HasSubstr("no.such.host.invalid"));
}

TEST(ResolveNetwork, LeavesItselfOutOfThePeers) {
  EXPECT_THAT(resolve(given({"wlan0"}, {"192.168.1.10", "192.168.1.11"}), kPresent).peers,
              ElementsAre("192.168.1.11"));
}

TEST(ResolveNetwork, ArgumentsStateTheSame) {
  EXPECT_THAT(
      resolve(given({"wlan0"}, {"192.168.1.11"}), kPresent).arguments(),
      ElementsAre("--interface", "192.168.1.10", "--peer", "192.168.1.11", "--max-message-bytes", "1400"));
}

}  // namespace
}  // namespace omnifleet::bus
