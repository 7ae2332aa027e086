// The network addresses that a fleet uses must exist and be up.

#include "bus/interfaces.h"

#include <gmock/gmock.h>
#include <sched.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cstdio>

#include "options/options.h"

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
  constexpr int kNotPermitted = 77;
  int pipe_ends[2];
  ASSERT_EQ(::pipe(pipe_ends), 0);
  const pid_t child = ::fork();
  if (child == 0) {
    if (::unshare(CLONE_NEWNET) != 0) ::_exit(kNotPermitted);
    try {
      requireAddresses({"127.0.0.1"});
    } catch (const options::Error& error) {
      ::dprintf(pipe_ends[1], "%s", error.what());
      ::_exit(2);
    }
    ::_exit(0);
  }
  ::close(pipe_ends[1]);
  std::string text;
  char buffer[512];
  for (ssize_t got = 0; (got = ::read(pipe_ends[0], buffer, sizeof buffer)) > 0;)
    text.append(buffer, static_cast<std::size_t>(got));
  ::close(pipe_ends[0]);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  if (WEXITSTATUS(status) == kNotPermitted) GTEST_SKIP() << "network namespaces are not permitted here";
  EXPECT_EQ(WEXITSTATUS(status), 2);
  EXPECT_THAT(text, HasSubstr("the loopback interface is down"));
  EXPECT_THAT(text, HasSubstr("ip link set lo up"));
}

}  // namespace
}  // namespace omnifleet::bus
