// The clock that a header names: time of a simulation stays time of a simulation, also in a live run.

#include <gtest/gtest.h>

#include <cstdlib>

#include "common/inlet.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

class ClockLabel : public testing::TestWithParam<bus::RunMode> {};

TEST_P(ClockLabel, OfArenaIsSimulationTimeInEveryMode) {
  test::StageBench bench("classifier", "r1", {}, {}, GetParam());
  const auto maps = bench.bus().writer(bench.topics.local_map, "r1");
  const auto objects = bench.bus().reader(bench.topics.objects, "r1");
  v1::LocalMap map;
  map.robot("r1");
  map.header().acquired_ns(5);
  ASSERT_TRUE(maps->write(map));
  bench.spin();
  v1::Objects received;
  ASSERT_TRUE(objects->take(received));
  EXPECT_EQ(received.header().clock(), v1::CLOCK_SIM);
}

INSTANTIATE_TEST_SUITE_P(Modes, ClockLabel, testing::Values(bus::RunMode::kLive, bus::RunMode::kLockstep));

TEST(ClockOfRun, FollowsSourceOfTimes) {
  bus::ServiceOptions live, replay;
  live.mode = bus::RunMode::kLive;
  replay.mode = bus::RunMode::kReplay;
  fleet::Fleet sensors, recording, simulation;
  recording.dataset = "some/folder";
  simulation.arena.emplace();
  using Clock = adapters::RunClock;
  EXPECT_EQ(services::runClock(live, sensors), Clock::kSystem);
  EXPECT_EQ(services::runClock(replay, sensors), Clock::kDataset);
  EXPECT_EQ(services::runClock(live, recording), Clock::kDataset);
  EXPECT_EQ(services::runClock(live, simulation), Clock::kSim);
}

}  // namespace
}  // namespace omnifleet
