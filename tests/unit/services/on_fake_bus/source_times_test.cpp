// Streams whose clock is set, and streams that never meet the frames. The clocks are the test's own.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>

#include "common/overlap_check.h"
#include "common/source_times.h"
#include "local_mapper/service.h"
#include "tests/test_data.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet::services {
namespace {

using ::testing::HasSubstr;

constexpr TimeNs kMs = 1000000, kSec = 1000 * kMs, kHour = 3600 * kSec;
constexpr TimeNs kLimitNs = 50 * kMs;

/// A host whose system clock the test sets.
struct FakeHost {
  TimeNs monotonic_ns = 1000 * kSec;
  TimeNs offset_ns = 1700000000 * kSec;

  ReadClocks clocks() {
    return [this]() -> ClockReading { return {monotonic_ns + offset_ns, monotonic_ns}; };
  }
  TimeNs system() const { return monotonic_ns + offset_ns; }
};

class SourceTimesTest : public testing::Test {
 protected:
  FakeHost host_;
  HostClock run_{host_.clocks()};
  SourceTimes times_{"wheels/odometry r1", run_, host_.clocks(), kLimitNs};
};

TEST_F(SourceTimesTest, HostClockKeepsTimeWhenSystemClockIsSet) {
  ClockWatch watch(run_, kLimitNs);
  const TimeNs before_ns = run_.now();
  host_.monotonic_ns += kSec;
  host_.offset_ns -= kHour;
  EXPECT_EQ(run_.now(), before_ns + kSec);
  EXPECT_EQ(run_.jump(), -kHour);
  EXPECT_EQ(watch.check(), -kHour);
  EXPECT_EQ(watch.check(), 0) << "once";
  host_.offset_ns += 30 * kMs;
  EXPECT_EQ(watch.check(), 0) << "below the limit";
  host_.offset_ns += 30 * kMs;
  EXPECT_EQ(watch.check(), 60 * kMs) << "their sum is not";
}

TEST_F(SourceTimesTest, ProcessesOfOneRunShareTheClock) {
  const test::TempFolder out;
  {
    const SharedClock first(out.path(), host_.clocks());
    host_.offset_ns -= kHour;
    const SharedClock second(out.path(), host_.clocks());
    EXPECT_EQ(first.clock().offset(), second.clock().offset());
  }
  const SharedClock of_the_next_run(out.path(), host_.clocks());
  EXPECT_EQ(of_the_next_run.clock().offset(), host_.offset_ns);
}

/// By this much the clock of the host is set.
class HostJump : public SourceTimesTest, public testing::WithParamInterface<TimeNs> {};

TEST_P(HostJump, StampsOfThisHostFollowTheRunExactly) {
  for (int i = 0; i < 40; ++i) {
    if (i == 20) host_.offset_ns += GetParam();
    const TimeNs stamp_ns = host_.system(), acquired_ns = run_.now();
    host_.monotonic_ns += 5 * kMs;  // on its way
    const TimeNs error_ns = times_.toRun(stamp_ns) - acquired_ns;
    // Near corrections need three samples; then, as for large jumps at once, no error remains.
    const bool is_settled = i < 20 || std::abs(GetParam()) >= kSec || i >= 23;
    EXPECT_TRUE(error_ns == 0 || !is_settled) << i;
    host_.monotonic_ns += 95 * kMs;
  }
  const auto message = times_.takeMessage();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->code, ErrorCode::kClockJump);
  EXPECT_THAT(message->text, HasSubstr(clockSet(GetParam())));
  EXPECT_FALSE(times_.takeMessage());
}

TEST_P(HostJump, StampsOfAnotherHostStayAsTheyAre) {
  const TimeNs other_offset_ns = host_.offset_ns;
  for (int i = 0; i < 40; ++i) {
    if (i == 20) host_.offset_ns += GetParam();
    const TimeNs stamp_ns = host_.monotonic_ns + other_offset_ns;
    host_.monotonic_ns += 5 * kMs;
    EXPECT_EQ(times_.toRun(stamp_ns), stamp_ns) << i;
    host_.monotonic_ns += 95 * kMs;
  }
  EXPECT_FALSE(times_.takeMessage());
}

INSTANTIATE_TEST_SUITE_P(Jumps, HostJump, testing::Values(-kHour, -10 * kSec, -100 * kMs, 10 * kSec, kHour));

TEST_F(SourceTimesTest, StreamOfAnotherHostContinuesWhenItsClockIsSetBack) {
  TimeNs other_offset_ns = host_.offset_ns;
  int misplaced = 0;
  for (int i = 0; i < 40; ++i) {
    if (i == 20) other_offset_ns -= kHour;
    const TimeNs acquired_ns = run_.now(), stamp_ns = host_.monotonic_ns + other_offset_ns;
    host_.monotonic_ns += 5 * kMs;
    misplaced += std::abs(times_.toRun(stamp_ns) - acquired_ns) > 10 * kMs;
    host_.monotonic_ns += 95 * kMs;
  }
  EXPECT_EQ(misplaced, SourceTimes::kBackward - 1) << "they show that the clock was set";
  const auto message = times_.takeMessage();
  ASSERT_TRUE(message);
  EXPECT_THAT(message->text, HasSubstr("set back by 36"));
}

TEST_F(SourceTimesTest, LateOrRepeatedSamplesAreNotASetClock) {
  for (int i = 0; i < 60; ++i) {
    TimeNs stamp_ns = host_.system();
    if (i % 10 == 5) stamp_ns -= 3 * kSec;         // single samples of the past
    if (i >= 30 && i < 40) stamp_ns -= 900 * kMs;  // out of order
    EXPECT_EQ(times_.toRun(stamp_ns), stamp_ns) << i;
    host_.monotonic_ns += 100 * kMs;
    if (i == 50) host_.monotonic_ns += 15 * kSec;  // the process was suspended
  }
  EXPECT_FALSE(times_.takeMessage());
}

TEST(OverlapCheckTest, ReportsRecordedStreamsThatDoNotMeet) {
  OverlapCheck check("laser r1", "camera r1/fisheye", false);
  for (int i = 0; i < 20; ++i)
    EXPECT_FALSE(check.addFrame(1000 * kSec + i * 100 * kMs, TimeRange{kSec, kSec + i * kMs}));
  const auto message = check.finish();
  ASSERT_TRUE(message);
  EXPECT_EQ(message->code, ErrorCode::kClockOffset);
  EXPECT_THAT(message->text, HasSubstr("camera r1/fisheye: 1000.000 to 1001.900 s"));
  EXPECT_THAT(message->text, HasSubstr("laser r1: 1.000 to 1.019 s"));
  EXPECT_THAT(message->text, HasSubstr("Likely cause: times of laser r1 seem to be in microseconds"));
  EXPECT_FALSE(check.finish()) << "once";
}

TEST(OverlapCheckTest, ReportsLiveStreamWhoseTimesAreFarFromTheFrames) {
  OverlapCheck check("measurement ceiling/c1", "frames of the robots", true);
  int reported = 0;
  for (int i = 0; i < 100; ++i) {
    const TimeNs frame_ns = 1700000000 * kSec + i * 100 * kMs;
    const auto message = check.addFrame(frame_ns, TimeRange{1699990000 * kSec, frame_ns - kHour});
    if (!message) continue;
    ++reported;
    EXPECT_EQ(i, OverlapCheck::kFrames - 1);
    EXPECT_THAT(message->text, HasSubstr("-1 h off"));
  }
  EXPECT_EQ(reported, 1);
}

TEST(OverlapCheckTest, AcceptsDelayedSilentAndAbsentStreams) {
  OverlapCheck delayed("a", "frames", true), silent("b", "frames", true), absent("c", "frames", true),
      burst("d", "frames", true);
  for (int i = 0; i < 200; ++i) {
    const TimeNs frame_ns = 1700000000 * kSec + i * 100 * kMs;
    EXPECT_FALSE(delayed.addFrame(frame_ns, TimeRange{0, frame_ns - 2 * kSec}));
    EXPECT_FALSE(silent.addFrame(frame_ns, TimeRange{0, 1700000000 * kSec - kSec}));
    EXPECT_FALSE(absent.addFrame(frame_ns, std::nullopt));
    // frames of the past that a restarted localizer takes all at once
    EXPECT_FALSE(burst.addFrame(frame_ns - 60 * kSec, TimeRange{0, 1700000000 * kSec + i * kMs}));
  }
}

/// The local mapper of a robot with a laser and wheels whose base stamps with the system clock of this host.
TEST(SetClockOfStage, LosesAtMostOneSampleOfLaserAndWheels) {
  const test::TempFolder folder;
  std::ofstream(folder / "laser.yaml") << "position_m: [0, 0, 0.1]\nrange_max_m: 5\n";
  std::ofstream(folder / "fleet.yaml") << "robots: {r1: {body: {radius_m: 0.15, height_m: 0.3}, "
                                          "wheel_separation_m: 0.26, wheels: true, laser: "
                                          "laser.yaml}}\n";
  const auto network = bus::makeFakeNetwork();
  const auto stage_bus = bus::makeFakeBus(network, {}), test_bus = bus::makeFakeBus(network, {});
  const bus::Topics topics(bus::RunMode::kLive);
  bus::ServiceOptions options;
  options.fleet = folder / "fleet.yaml";
  options.robot = "r1";
  options.mode = bus::RunMode::kLive;
  FakeHost host;
  LaserMapperService stage(
      {*stage_bus, options, topics,
       std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>())},
      fleet::Fleet::load(options.fleet, {}, {}), host.clocks());
  const auto scans = test_bus->writer(topics.laser, "r1");
  const auto wheels = test_bus->writer(topics.wheels_odometry, "r1");
  const auto maps = test_bus->reader(topics.local_map, "r1");
  stage.start();
  int maps_seen = 0, with_motion = 0;
  TimeNs last_ns = 0;
  constexpr int kScans = 40;
  for (int i = 0; i < kScans; ++i) {
    if (i == kScans / 2) host.offset_ns -= kHour;
    v1::WheelOdometry speeds;
    speeds.robot("r1");
    speeds.header().acquired_ns(host.system() - 1);
    speeds.v_left_mps(0.1);
    speeds.v_right_mps(0.1);
    ASSERT_TRUE(wheels->write(speeds));
    v1::LaserScan scan;
    scan.robot("r1");
    scan.header().acquired_ns(host.system());
    scan.angle_increment_rad(2.0 * M_PI / 90);
    scan.range_max_m(5.0);
    scan.range_m().assign(90, 2.0f);
    ASSERT_TRUE(scans->write(scan));
    host.monotonic_ns += kMs;
    while (stage.spin()) continue;
    v1::LocalMap map;
    while (maps->take(map)) {
      ++maps_seen;
      with_motion += map.motion().valid();
      EXPECT_GT(map.header().acquired_ns(), last_ns);
      last_ns = map.header().acquired_ns();
    }
    host.monotonic_ns += 199 * kMs;
  }
  EXPECT_GE(maps_seen, kScans - 1) << "a set clock costs at most one period";
  EXPECT_GE(with_motion, kScans - 3);
  std::size_t jumps = 0;
  for (const Message& message : stage.status().takeMessages()) jumps += message.code == ErrorCode::kClockJump;
  EXPECT_EQ(jumps, 2u) << "one for each stream";
}

}  // namespace
}  // namespace omnifleet::services
