// Replicas of the map as processes on DDS: a killed, a late and a duplicate one; traffic of a whole fleet.

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <signal.h>

#include <map>
#include <set>

#include "tests/multiprocess/live_fleet.h"
#include "tests/multiprocess/merger_feed.h"

namespace omnifleet::test {
namespace {

using namespace std::chrono_literals;
using testing::HasSubstr;

/// Global mergers of the small fleet. The test plays all other stages.
class Replicas {
 public:
  Replicas(const std::string& name, int domain)
      : out(freshDir(name)), listener(domain), feed(listener.bus()), domain_(domain) {
    MergerFeed::writeOverlay(out + "/overlay.yaml", "settle_s: 0.3, max_bytes_per_s: 2000000");
  }

  std::unique_ptr<Process> start(const std::string& robot, int incarnation = 1) {
    const std::string log = out + "/" + robot + "_" + std::to_string(++started_) + ".log";
    return std::make_unique<Process>(
        std::vector<std::string>{program("global_merger"), "--fleet", smallFleet(), "--robot", robot,
                                 "--mode", "live", "--config", out + "/overlay.yaml", "--out", out + "/run",
                                 "--domain", std::to_string(domain_), "--incarnation",
                                 std::to_string(incarnation)},
        log);
  }
  /// Feeds frames at 25 Hz. @return false if a frame could not be written
  bool drive(int frames) {
    for (int i = 0; i < frames; ++i) {
      if (!feed.frame()) return false;
      const auto next = std::chrono::steady_clock::now() + 40ms;
      listener.until([&] { return take(), std::chrono::steady_clock::now() >= next; }, 1s);
    }
    return true;
  }
  /// Lets time pass without contributions until `condition` about the last hashes holds.
  bool idleUntil(const std::function<bool()>& condition, std::chrono::seconds timeout) {
    const auto end = std::chrono::steady_clock::now() + timeout;
    for (take(); !condition(); take()) {
      if (std::chrono::steady_clock::now() >= end || !feed.idleFrame()) return false;
      listener.bus().wait(100ms);
    }
    return true;
  }
  void take() {
    v1::MapHash hash;
    while (hashes->take(hash)) last[hash.replica().to_string()] = hash;
  }
  bool areEqual() { return last["r1"].sha256() == last["r2"].sha256(); }
  /// Stops both and takes their last hashes.
  void stop(Process& first, Process& second) {
    first.signal(SIGTERM);
    second.signal(SIGTERM);
    EXPECT_EQ(first.wait(10s), 128 + SIGTERM) << first.output();
    EXPECT_EQ(second.wait(10s), 128 + SIGTERM) << second.output();
    listener.bus().wait(100ms);
    take();
  }

  std::string out;
  Listener listener;
  MergerFeed feed;
  std::unique_ptr<bus::Reader<v1::MapHash>> hashes = listener.bus().reader(listener.topics().map_hash);
  std::map<std::string, v1::MapHash> last;

 private:
  int domain_;
  int started_ = 0;
};

TEST(Replication, KilledReplicaRegainsContributionsBeyondTheHistory) {
  constexpr std::uint32_t kBefore = 100, kAfter = 10;
  Replicas replicas("replica_killed", 101);
  auto r1 = replicas.start("r1"), r2 = replicas.start("r2");
  ASSERT_TRUE(replicas.feed.waitForReaders(1, 2, 30s));
  ASSERT_TRUE(replicas.drive(kBefore));
  ASSERT_TRUE(replicas.idleUntil([&] { return replicas.last["r2"].contributions() == kBefore; }, 20s))
      << replicas.last["r2"].contributions() << r2->output();
  r1->signal(SIGKILL);
  ASSERT_TRUE(r1->wait(5s));
  // The readers of the killed process stay matched until its lease expires. No frame may be lost here.
  ASSERT_TRUE(replicas.idleUntil([&] { return replicas.feed.objectReaders() == 0; }, 20s));
  replicas.last.clear();
  r1 = replicas.start("r1", 2);
  ASSERT_TRUE(replicas.feed.waitForReaders(1, 2, 30s)) << r1->output();
  ASSERT_TRUE(replicas.drive(kAfter));
  const auto contributions = [&](const std::string& replica) {
    return replicas.last[replica].contributions();
  };
  EXPECT_TRUE(replicas.idleUntil(
      [&] { return contributions("r1") == kBefore + kAfter && contributions("r2") == kBefore + kAfter; },
      20s))
      << contributions("r1") << " and " << contributions("r2") << " contributions\n"
      << r1->output();
  replicas.stop(*r1, *r2);
  EXPECT_EQ(contributions("r1"), kBefore + kAfter);
  EXPECT_TRUE(replicas.areEqual());
  EXPECT_THAT(r1->output(), testing::Not(HasSubstr("duplicate_robot"))) << "the killed process is no rival";
}

TEST(Replication, LateReplicaReceivesEverything) {
  constexpr std::uint32_t kFrames = 100;
  Replicas replicas("replica_late", 102);
  auto r1 = replicas.start("r1");
  ASSERT_TRUE(replicas.feed.waitForReaders(1, 1, 30s));
  ASSERT_TRUE(replicas.drive(kFrames));
  auto r2 = replicas.start("r2");
  ASSERT_TRUE(replicas.feed.waitForReaders(1, 2, 30s));
  EXPECT_TRUE(replicas.idleUntil([&] { return replicas.last["r2"].contributions() == kFrames; }, 20s))
      << replicas.last["r2"].contributions() << " contributions\n"
      << r2->output();
  replicas.stop(*r1, *r2);
  EXPECT_EQ(replicas.last["r1"].contributions(), kFrames);
  EXPECT_TRUE(replicas.areEqual());
}

/// As a robot that was out of reach of the others: its participant is gone for them, and they for it.
TEST(Replication, SuspendedReplicaRegainsWhatItMissed) {
  constexpr std::uint32_t kFrames = 120;
  Replicas replicas("replica_suspended", 105);
  auto r1 = replicas.start("r1"), r2 = replicas.start("r2");
  ASSERT_TRUE(replicas.feed.waitForReaders(1, 2, 30s));
  ASSERT_TRUE(replicas.drive(10));
  ASSERT_TRUE(replicas.idleUntil([&] { return replicas.last["r2"].contributions() == 10U; }, 20s));
  r2->signal(SIGSTOP);
  ASSERT_TRUE(replicas.drive(kFrames - 10));  // more than the history, longer than the lease of 3 s
  r2->signal(SIGCONT);
  EXPECT_TRUE(replicas.idleUntil([&] { return replicas.last["r2"].contributions() == kFrames; }, 20s))
      << replicas.last["r2"].contributions() << " contributions\n"
      << r2->output();
  replicas.stop(*r1, *r2);
  EXPECT_EQ(replicas.last["r1"].contributions(), kFrames);
  EXPECT_TRUE(replicas.areEqual());
}

/// Two machines that were started with the same robot name.
TEST(Replication, SecondMergerOfOneRobotAddsNothingToTheMap) {
  Replicas replicas("replica_duplicate", 103);
  auto statuses = replicas.listener.bus().reader(replicas.listener.topics().service_status);
  auto contributions = replicas.listener.bus().reader(replicas.listener.topics().map_contribution);
  auto owner = replicas.start("r1");
  v1::ServiceStatus status;
  ASSERT_TRUE(replicas.listener.untilSample<v1::ServiceStatus>(
      *statuses, status, [](const v1::ServiceStatus& s) { return s.state() == v1::SERVICE_RUNNING; }, 20s));
  auto second = replicas.start("r1");
  ASSERT_TRUE(replicas.listener.untilSample<v1::ServiceStatus>(
      *statuses, status,
      [](const v1::ServiceStatus& s) {  // it may notice the conflict while it still starts
        return s.error_code() == "duplicate_robot" && s.state() == v1::SERVICE_DEGRADED;
      },
      20s))
      << second->output();
  EXPECT_EQ(static_cast<pid_t>(status.process_id()), second->pid());
  ASSERT_TRUE(replicas.feed.waitForReaders(2, 2, 20s)) << "both receive the frames of r1";
  ASSERT_TRUE(replicas.drive(20));
  int received = 0;
  v1::Contribution contribution;
  const auto take = [&] {
    while (contributions->take(contribution)) ++received;
    return received >= 20;
  };
  EXPECT_TRUE(replicas.listener.until(take, 10s));
  replicas.idleUntil([] { return false; }, 1s);
  take();
  EXPECT_EQ(received, 20) << "each frame is contributed once";

  // The second one takes over: it is the only one left.
  owner->signal(SIGKILL);
  ASSERT_TRUE(owner->wait(5s));
  ASSERT_TRUE(replicas.listener.untilSample<v1::ServiceStatus>(
      *statuses, status,
      [&](const v1::ServiceStatus& s) {
        return static_cast<pid_t>(s.process_id()) == second->pid() && s.error_code() == "" &&
               s.state() == v1::SERVICE_RUNNING;
      },
      10s));
  EXPECT_EQ(status.instance(), "r1");
  ASSERT_TRUE(replicas.drive(5));
  received = 0;
  EXPECT_TRUE(replicas.listener.until([&] { return take(), received >= 5; }, 10s));
  second->signal(SIGTERM);
  EXPECT_EQ(second->wait(10s), 128 + SIGTERM);
}

/// The budget of a robot's radio link. Counted as payload: pose, map/*, formation/*, service/status.
TEST(Replication, MappingRobotWritesAtMostFiftyKilobytesPerSecondToOtherHosts) {
  LiveFleet fleet("traffic", 104);
  auto statuses = fleet.listener.bus().reader(fleet.listener.topics().service_status);
  const std::set<std::string> of_robot{"local_mapper", "classifier", "formation", "global_merger"};
  std::map<std::string, std::map<std::string, double>> rates;  // robot, service: bytes/s
  std::map<std::string, double> highest;                       // sum of a robot
  v1::ServiceStatus status;
  std::uint64_t frames = 0;
  ASSERT_TRUE(fleet.listener.until(
      [&] {
        while (statuses->take(status)) {
          const std::string service = status.service().to_string(), robot = status.instance().to_string();
          if (of_robot.count(service) == 0) continue;
          if (service == "global_merger") frames = std::max<std::uint64_t>(frames, status.processed());
          rates[robot][service] = status.bytes_out_per_s();
          double sum = 0;
          for (const auto& [name, rate] : rates[robot]) sum += rate;
          highest[robot] = std::max(highest[robot], sum);
        }
        return frames >= 60;  // twelve seconds at 5 Hz, the drive to the waypoint included
      },
      90s))
      << fleet.launch.output();
  ASSERT_EQ(highest.size(), 2U);
  for (const auto& [robot, bytes_per_s] : highest) {
    RecordProperty("bytes_per_s_" + robot, static_cast<int>(bytes_per_s));
    EXPECT_GT(bytes_per_s, 3000.0) << robot << " must be mapping";
    EXPECT_LE(bytes_per_s, 50000.0) << robot;
  }
}

}  // namespace
}  // namespace omnifleet::test
