// Two processes that claim to be the same stage of the same robot.

#include "bus/robot_claim.h"

#include <gmock/gmock.h>

#include <thread>

#include "tests/unit/bus/any_bus.h"
#include "tests/unit/bus/peer_process.h"

namespace omnifleet::bus {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using testing::HasSubstr;
using testing::StartsWith;
using Clock = std::chrono::steady_clock;

TEST(RobotClaim, SurvivesUserData) {
  RobotClaim claim = RobotClaim::ofThisProcess("global_merger", "r1");
  claim.host = "robot one; really=odd";
  claim.host.erase(claim.host.find(';'), 1);
  const auto read = RobotClaim::parse(claim.userData());
  ASSERT_TRUE(read);
  EXPECT_TRUE(read->isSameStage(claim));
  EXPECT_EQ(read->host, claim.host);
  EXPECT_EQ(read->machine, claim.machine);
  EXPECT_EQ(read->pid, ::getpid());
  EXPECT_EQ(read->since_ns, claim.since_ns);
  EXPECT_FALSE(claim.machine.empty());
}

TEST(RobotClaim, RejectsOtherUserData) {
  EXPECT_FALSE(RobotClaim::parse(""));
  EXPECT_FALSE(RobotClaim::parse("omnifleet.idl=0123"));
  EXPECT_FALSE(RobotClaim::parse("omnifleet.claim=global_merger"));
  EXPECT_FALSE(RobotClaim::parse("omnifleet.claim=global_merger/r1;machine=m;pid=x;since_ns=1;host=h"));
  EXPECT_FALSE(RobotClaim::parse("omnifleet.claim=global_merger/r1;machine=m;pid=1;since_ns=1y;host=h"));
}

TEST(RobotClaim, OlderOneOwnsTheRobotAndIdsDecideBetweenEqualTimes) {
  RobotClaim older, younger;
  older.since_ns = 5;
  younger.since_ns = 6;
  EXPECT_TRUE(outranks(older, "b", younger, "a"));
  EXPECT_FALSE(outranks(younger, "a", older, "b"));
  EXPECT_TRUE(outranks(older, "a", older, "b"));
  EXPECT_FALSE(outranks(older, "b", older, "a"));
}

TEST(RobotClaim, EndedProcessOfThisMachineIsNoRival) {
  const RobotClaim self = RobotClaim::ofThisProcess("global_merger", "r1");
  const pid_t child = ::fork();
  if (child == 0) ::_exit(0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  RobotClaim other = self;
  EXPECT_TRUE(other.isAlive(self));
  other.pid = child;
  EXPECT_FALSE(other.isAlive(self));
  other.machine += "'s neighbour";
  EXPECT_TRUE(other.isAlive(self)) << "process numbers of another machine mean nothing here";
}

class TwoParticipants : public testing::Test {
 protected:
  std::unique_ptr<Bus> join(const std::string& service, const std::string& robot) const {
    Participant participant;
    participant.mode = RunMode::kLive;
    participant.claim = RobotClaim::ofThisProcess(service, robot);
    return network.join(participant);
  }
  /// Waits until the bus has a rival, or none. Returns the time that this took.
  static Clock::duration waitForRival(Bus& bus, bool any) {
    const auto begin = Clock::now();
    while (bus.rival().empty() == any && Clock::now() - begin < kPatience) bus.wait(milliseconds(20));
    return Clock::now() - begin;
  }
  Network network{true};
  Topics topics{RunMode::kLive};
};

TEST_F(TwoParticipants, SecondOnePublishesNothingUntilFirstOneHasEnded) {
  auto first = join("global_merger", "r1");
  const auto second = join("global_merger", "r1");
  EXPECT_LT(waitForRival(*second, true), seconds(1));
  EXPECT_THAT(second->rival(), StartsWith("process " + std::to_string(::getpid()) + " on host "));
  const auto listener = network.join();
  const auto poses = listener->reader(topics.pose);
  const auto statuses = listener->reader(topics.service_status);
  auto of_first = first->writer(topics.pose, "r1"), of_second = second->writer(topics.pose, "r1");
  const auto status_of_second = second->writer(topics.service_status);
  ASSERT_TRUE(of_first->waitForReaders(1, kPatience));
  ASSERT_TRUE(of_second->waitForReaders(1, kPatience));
  ASSERT_TRUE(status_of_second->waitForReaders(1, kPatience));
  ASSERT_TRUE(of_second->write(poseOf("r1", 1))) << "discarded";
  ASSERT_TRUE(status_of_second->write(v1::ServiceStatus()));
  ASSERT_TRUE(of_first->write(poseOf("r1", 2)));
  const auto got = receive(*listener, *poses, 1);
  ASSERT_EQ(got.size(), 1U);
  EXPECT_EQ(got.front().header().acquired_ns(), 2);
  EXPECT_EQ(receive(*listener, *statuses, 1).size(), 1U) << "the status reports the conflict";
  EXPECT_EQ(first->rival(), "") << "the owner continues";
  of_first.reset();
  first.reset();
  EXPECT_LT(waitForRival(*second, false), seconds(1));
  ASSERT_TRUE(of_second->write(poseOf("r1", 3)));
  const auto after = receive(*listener, *poses, 1);
  ASSERT_EQ(after.size(), 1U);
  EXPECT_EQ(after.front().header().acquired_ns(), 3);
}

TEST_F(TwoParticipants, OtherStagesAndRobotsAreNoRivals) {
  const auto merger = join("global_merger", "r1");
  const auto others = {join("local_mapper", "r1"), join("global_merger", "r2"), network.join()};
  const auto reader = merger->reader(topics.pose);
  for (const auto& other : others) {
    const auto writer = other->writer(topics.pose);
    ASSERT_TRUE(writer->waitForReaders(1, kPatience));  // both have discovered each other
    EXPECT_EQ(other->rival(), "");
    EXPECT_EQ(merger->rival(), "");
  }
}

/// As two machines that were started with the same robot name: a process of its own, with its status.
TEST_F(TwoParticipants, SecondProcessReportsConflictWithinOneSecond) {
  const auto owner = join("peer", "r1");
  const auto listener = network.join();
  const auto statuses = listener->reader(topics.service_status);
  const auto begin = Clock::now();
  Peer second({"service", "--domain", std::to_string(ownDomain()), "--robot", "r1", "--mode", "live"});
  const auto ready = Clock::now();
  v1::ServiceStatus status;
  const auto isReported = [&] {
    return status.error_code() == "duplicate_robot" && status.state() == v1::SERVICE_DEGRADED;
  };
  while (!isReported() && Clock::now() - begin < kPatience) {
    if (!statuses->take(status)) listener->wait(milliseconds(50));
  }
  EXPECT_TRUE(isReported()) << status.error_code().to_string() << " in state " << status.state();
  EXPECT_LT(Clock::now() - ready, seconds(1));
  EXPECT_THAT(status.instance().to_string(), StartsWith("r1@"));
  EXPECT_THAT(status.last_error().to_string(), HasSubstr("process " + std::to_string(::getpid())));
  EXPECT_EQ(second.end(SIGTERM), 128 + SIGTERM);
}

/// A process that is killed stays in the discovery data for the lease of 3 s.
TEST_F(TwoParticipants, RestartedProcessOwnsTheRobotAtOnce) {
  const std::vector<std::string> arguments{
      "service", "--domain", std::to_string(ownDomain()), "--robot", "r1", "--mode", "live"};
  const auto listener = network.join();
  const auto statuses = listener->reader(topics.service_status);
  const auto isRunning = [&](const v1::ServiceStatus& s) { return s.state() == v1::SERVICE_RUNNING; };
  std::uint32_t killed = 0;
  for (int incarnation = 0; incarnation < 2; ++incarnation) {
    Peer peer(arguments);
    v1::ServiceStatus status;
    const auto begin = Clock::now();
    while ((!isRunning(status) || status.process_id() == killed) && Clock::now() - begin < kPatience) {
      if (!statuses->take(status)) listener->wait(milliseconds(50));
    }
    EXPECT_TRUE(isRunning(status));
    EXPECT_EQ(status.error_code(), "");
    EXPECT_EQ(status.instance(), "r1");
    killed = status.process_id();
    peer.end(SIGKILL);
  }
}

}  // namespace
}  // namespace omnifleet::bus
