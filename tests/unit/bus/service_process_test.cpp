// runService() as a process: signals, exit codes, status on DDS.

#include <gmock/gmock.h>

#include "tests/unit/bus/any_bus.h"
#include "tests/unit/bus/peer_process.h"

namespace omnifleet::bus {
namespace {

using Clock = std::chrono::steady_clock;

std::vector<std::string> service(const std::string& mode, std::vector<std::string> more = {}) {
  std::vector<std::string> arguments = {"service", "--domain", std::to_string(ownDomain()), "--robot", "r1",
                                        "--mode",  mode};
  arguments.insert(arguments.end(), more.begin(), more.end());
  return arguments;
}

class ServiceProcess : public testing::Test {
 protected:
  /// The next status of the service; a default status after kPatience.
  v1::ServiceStatus status() {
    const auto got = receive(*bus, *statuses, 1);
    return got.empty() ? v1::ServiceStatus() : got.front();
  }
  void waitFor(v1::ServiceState state) {
    const auto deadline = Clock::now() + kPatience;
    while (status().state() != state) ASSERT_LT(Clock::now(), deadline);
  }
  static DdsBusOptions options() {
    DdsBusOptions result;
    result.domain = ownDomain();
    return result;
  }
  std::unique_ptr<Bus> bus = makeDdsBus(options());
  Topics topics{RunMode::kReplay};
  std::unique_ptr<Writer<v1::Pose>> poses = bus->writer(topics.pose, "r1");
  std::unique_ptr<Reader<v1::FormationState>> answers = bus->reader(topics.formation_state);
  std::unique_ptr<Reader<v1::ServiceStatus>> statuses = bus->reader(topics.service_status);
};

class Signals : public ServiceProcess, public testing::WithParamInterface<int> {};

TEST_P(Signals, EndRunningServiceWithinTwoSecondsWithStatus) {
  Peer peer(service("live"));
  waitFor(v1::SERVICE_RUNNING);
  const auto before = Clock::now();
  EXPECT_EQ(peer.end(GetParam()), 128 + GetParam()) << "its work was not complete";
  EXPECT_LT(Clock::now() - before, std::chrono::seconds(2));
  EXPECT_EQ(peer.line(), "drained");
  waitFor(v1::SERVICE_FINISHED);
}
INSTANTIATE_TEST_SUITE_P(Each, Signals, testing::Values(SIGTERM, SIGINT));

TEST_F(ServiceProcess, SignalEndsServiceThatWaitsForPeers) {
  poses.reset();
  Peer peer;
  peer.start(service("replay"));
  waitFor(v1::SERVICE_WAITING);
  const auto before = Clock::now();
  EXPECT_EQ(peer.end(SIGTERM), 128 + SIGTERM);
  EXPECT_LT(Clock::now() - before, std::chrono::seconds(2));
}

TEST_F(ServiceProcess, EndsWithNormalExitCodeWhenDestructionHangs) {
  Peer peer(service("live", {"--behaviour", "hangs"}));
  waitFor(v1::SERVICE_RUNNING);
  EXPECT_EQ(peer.end(SIGTERM), 128 + SIGTERM) << "the exit code must not show the hanging destructor";
  EXPECT_EQ(peer.line(), "drained");
}

TEST_F(ServiceProcess, AnswersEverySampleAndEndsByItself) {
  Peer peer(service("replay"));
  ASSERT_TRUE(poses->waitForReaders(1, kPatience));
  ASSERT_TRUE(answers->waitForWriters(1, kPatience));
  for (std::uint32_t k = 0; k < 100; ++k) {
    auto pose = poseOf("r1", k);
    pose.header().sequence_number(k);
    ASSERT_TRUE(poses->write(pose));
  }
  const auto got = receive(*bus, *answers, 100);
  ASSERT_EQ(got.size(), 100u) << "the last one is " << (got.empty() ? -1 : got.back().header().acquired_ns());
  for (int k = 0; k < 100; ++k)
    EXPECT_EQ(got[k].header().acquired_ns(), k);  // includes the samples just before its end
  EXPECT_EQ(peer.end(0), 0);
}

TEST_F(ServiceProcess, ExitCodeNamesCauseOfFailure) {
  EXPECT_EQ(Peer(service("replay", {"--behaviour", "bad-options"})).end(0), 2);
  EXPECT_EQ(Peer(service("replay", {"--bogus"})).end(0), 2);
  EXPECT_EQ(Peer(service("replay", {"--silence-limit", "1"})).end(0), 3) << "no pose arrives";
  Peer throws(service("replay", {"--behaviour", "throws"}));
  ASSERT_TRUE(poses->waitForReaders(1, kPatience));
  ASSERT_TRUE(poses->write(poseOf("r1", 1)));
  EXPECT_EQ(throws.end(0), 1);
}

}  // namespace
}  // namespace omnifleet::bus
