// The network addresses that a fleet uses must exist and be up.

#include "bus/interfaces.h"

#include <gmock/gmock.h>

#include "options/options.h"
#include "tests/unit/bus/in_namespace.h"

namespace omnifleet::bus {
namespace {

using testing::AllOf;
using testing::HasSubstr;

std::string problemOf(const std::vector<std::string>& addresses, const std::vector<NetworkAddress>& present) {
  try {
    checkAddresses(addresses, present);
  } catch (const options::Error& error) {
    return error.what();
  }
  return {};
}

TEST(NetworkAddresses, AreAcceptedWhenPresentAndUp) {
  const std::vector<NetworkAddress> present{{"lo", "127.0.0.1", true}, {"eth0", "10.0.0.4", true}};
  EXPECT_EQ(problemOf({}, present), "");
  EXPECT_EQ(problemOf({"127.0.0.1"}, present), "");
  EXPECT_EQ(problemOf({"10.0.0.4", "127.0.0.1"}, present), "");
}

TEST(NetworkAddresses, AreRefusedWhenAbsentOrDown) {
  const std::vector<NetworkAddress> present{{"lo", "127.0.0.1", true}, {"eth0", "10.0.0.4", false}};
  EXPECT_THAT(problemOf({"127.0.0.1", "10.0.0.5"}, present),
              AllOf(HasSubstr("10.0.0.5"), HasSubstr("127.0.0.1 (lo)"), HasSubstr("10.0.0.4 (eth0, down)")));
  EXPECT_THAT(problemOf({"10.0.0.4"}, present), HasSubstr("ip link set eth0 up"));
  EXPECT_THAT(problemOf({"127.0.0.1"}, {}), HasSubstr("ip link set lo up"));
  EXPECT_THAT(problemOf({"eth0"}, present), HasSubstr("10.0.0.4 (eth0, down)"));
}

/// A robot that starts before its Wi-Fi network is there.
TEST(NetworkAddresses, AreRefusedWithoutCarrier) {
  const std::vector<NetworkAddress> present{{"lo", "127.0.0.1", true}, {"wlan0", "10.0.0.4", true, false}};
  EXPECT_THAT(problemOf({"10.0.0.4"}, present), HasSubstr("wlan0 is not connected"));
  EXPECT_THAT(listed(present), HasSubstr("10.0.0.4 (wlan0, not connected)"));
}

TEST(NetworkAddresses, HaveLoopbackHere) {
  EXPECT_NO_THROW(requireAddresses({"127.0.0.1"}));
}

/// A new network namespace has a loopback interface that is down.
TEST(NetworkAddresses, RefuseLoopbackThatIsDown) {
  const auto text = inNamespace(CLONE_NEWNET, "", [] {
    requireAddresses({"127.0.0.1"});
    return std::string("accepted");
  });
  if (!text) GTEST_SKIP() << "network namespaces are not permitted here";
  EXPECT_THAT(*text, AllOf(HasSubstr("the loopback interface is down"), HasSubstr("ip link set lo up")));
}

}  // namespace
}  // namespace omnifleet::bus
