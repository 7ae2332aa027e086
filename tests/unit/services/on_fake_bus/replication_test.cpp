// Replicas of the map on the fake bus in live mode: what one of them missed.

#include <gtest/gtest.h>
#include <spdlog/sinks/null_sink.h>

#include <cstdlib>
#include <filesystem>
#include <map>
#include <thread>

#include "bus/fake_bus.h"
#include "fleet_in_process/in_process.h"
#include "tests/multiprocess/merger_feed.h"

namespace omnifleet {
namespace {

using std::chrono::milliseconds;
using std::chrono::seconds;
using Clock = std::chrono::steady_clock;

class Replicas : public testing::Test {
 protected:
  struct Replica {
    std::unique_ptr<bus::Bus> bus;
    std::unique_ptr<bus::Service> service;
  };
  Replica start(const std::string& robot, bus::RunMode mode = bus::RunMode::kLive) const {
    Replica replica{bus::makeFakeBus(network_, {}), nullptr};
    bus::ServiceOptions options;
    options.fleet = std::string(std::getenv("OMNIFLEET_SOURCE_DIR")) + "/config/fleets/small.yaml";
    options.configs = {overlay_};
    options.robot = robot;
    options.mode = mode;
    auto log = std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>());
    replica.service = services::factoryOf("global_merger")({*replica.bus, options, bus::Topics(mode), log});
    replica.service->start();
    return replica;
  }
  void setOptions(const std::string& replication) const {
    test::MergerFeed::writeOverlay(overlay_, replication);
  }
  static void spin(Replica& replica) {
    while (replica.service->spin()) {
    }
  }
  void drive(std::initializer_list<Replica*> replicas, int frames) {
    for (int i = 0; i < frames; ++i) {
      ASSERT_TRUE(feed_.frame());
      for (Replica* replica : replicas) spin(*replica);
    }
  }
  /// Spins for a time: the clock limits the rate at which replicas re-send.
  static void spinFor(std::initializer_list<Replica*> replicas, milliseconds time) {
    for (const auto end = Clock::now() + time; Clock::now() < end;
         std::this_thread::sleep_for(milliseconds(2)))
      for (Replica* replica : replicas) spin(*replica);
  }
  /// The last hashes by replica. Every replica publishes one when it drains.
  std::map<std::string, v1::MapHash> hashes() {
    std::map<std::string, v1::MapHash> last;
    v1::MapHash hash;
    while (hashes_->take(hash)) last[hash.replica().to_string()] = hash;
    return last;
  }

  std::shared_ptr<bus::FakeNetwork> network_ = bus::makeFakeNetwork();
  std::unique_ptr<bus::Bus> bus_ = bus::makeFakeBus(network_, {});
  std::string overlay_ = testing::TempDir() + "/replication_" +
                         testing::UnitTest::GetInstance()->current_test_info()->name() + ".yaml";
  test::MergerFeed feed_{*bus_};
  bus::Topics topics_{bus::RunMode::kLive};
  std::unique_ptr<bus::Reader<v1::MapHash>> hashes_ = bus_->reader(topics_.map_hash);
};

TEST_F(Replicas, LateReplicaReceivesMoreThanTheHistory) {
  setOptions("settle_s: 0.1, max_bytes_per_s: 1e8, final_s: 0");
  Replica first = start("r1");
  drive({&first}, 150);
  Replica late = start("r2");
  spin(late);  // the history of 64
  spinFor({&first, &late}, milliseconds(2500));
  first.service->drain();
  late.service->drain();
  auto last = hashes();
  EXPECT_EQ(last["r1"].contributions(), 150U);
  EXPECT_EQ(last["r2"].contributions(), 150U);
  EXPECT_EQ(last["r1"].sha256(), last["r2"].sha256());
}

TEST_F(Replicas, RestartedReplicaRegainsItsOwnContributions) {
  setOptions("settle_s: 0.1, max_bytes_per_s: 1e8, final_s: 0");
  Replica killed = start("r1"), other = start("r2");
  drive({&killed, &other}, 150);
  killed.service.reset();
  killed.bus.reset();
  Replica restarted = start("r1");
  drive({&restarted, &other}, 10);
  spinFor({&restarted, &other}, milliseconds(2500));
  restarted.service->drain();
  other.service->drain();
  auto last = hashes();
  EXPECT_EQ(last["r1"].contributions(), 160U);
  EXPECT_EQ(last["r1"].sha256(), last["r2"].sha256());
}

TEST_F(Replicas, StoppingReplicasExchangeFirst) {
  setOptions("settle_s: 60, final_s: 1");  // nothing is re-sent before
  Replica first = start("r1");
  drive({&first}, 100);
  Replica late = start("r2");
  spin(late);
  spin(first);
  const auto begin = Clock::now();
  std::thread other([&] { late.service->drain(); });
  first.service->drain();
  other.join();
  EXPECT_LT(Clock::now() - begin, seconds(20)) << "bounded, whatever the load of the machine";
  auto last = hashes();
  EXPECT_EQ(last["r2"].contributions(), 100U);
  EXPECT_EQ(last["r1"].sha256(), last["r2"].sha256());
}

TEST_F(Replicas, ReplicaThatStopsAloneDoesNotWaitLong) {
  setOptions("final_s: 0.3");
  Replica first = start("r1"), second = start("r2");
  drive({&first, &second}, 3);
  const auto begin = Clock::now();
  second.service->drain();
  EXPECT_GE(Clock::now() - begin, milliseconds(300)) << "r1 may be about to stop as well";
  EXPECT_LT(Clock::now() - begin, seconds(10));
}

TEST_F(Replicas, ResendsAtTheLimitedRate) {
  setOptions("settle_s: 0.1, max_bytes_per_s: 10000, final_s: 0");
  auto resends = bus_->reader(topics_.map_resend);
  Replica first = start("r1");
  drive({&first}, 150);
  Replica late = start("r2");
  spin(late);
  spinFor({&first, &late}, seconds(3));
  std::size_t bytes = 0;
  v1::Resend resend;
  while (resends->take(resend)) bytes += v1::Resend::getCdrSerializedSize(resend) + 4;
  EXPECT_GT(bytes, 10000U);
  EXPECT_LT(bytes, 3U * 10000U + 2U * 10000U)
      << "3 s, the budget of one second before, one sample and a late look";
}

TEST_F(Replicas, DeterministicModesExchangeNothing) {
  setOptions("settle_s: 0");
  auto haves = bus_->reader(topics_.map_have);
  auto resends = bus_->reader(topics_.map_resend);
  const Replica replayed = start("r1", bus::RunMode::kReplay);
  EXPECT_EQ(haves->matched(), 0);
  EXPECT_EQ(resends->matched(), 0);
  const Replica live = start("r2");
  EXPECT_EQ(haves->matched(), 1);
  EXPECT_EQ(resends->matched(), 1);
}

/// A statement of an unknown kind, as of a later version.
TEST_F(Replicas, RejectsMalformedStatement) {
  setOptions("settle_s: 0");
  Replica first = start("r1");
  spin(first);
  auto writer = bus_->writer(topics_.map_have);
  v1::Have have;
  have.replica("r9");
  v1::HeldRange range;
  range.kind(7);
  have.ranges().push_back(range);
  ASSERT_TRUE(writer->write(have));
  spin(first);
  EXPECT_EQ(first.service->status().snapshot(Clock::now()).last_error.code, ErrorCode::kSampleRejected);
}

}  // namespace
}  // namespace omnifleet
