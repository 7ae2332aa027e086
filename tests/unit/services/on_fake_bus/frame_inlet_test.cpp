// The end of a camera's frames, including the case in which the last frames were lost.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "common/frame_inlet.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

/// A camera that announces five frames, of which three arrive.
class LostFrames : public testing::TestWithParam<bus::RunMode> {
 protected:
  LostFrames()
      : network_(bus::makeFakeNetwork()),
        camera_bus_(bus::makeFakeBus(network_, {})),
        inlet_bus_(bus::makeFakeBus(network_, {})),
        topics_(GetParam()) {
    options_.mode = GetParam();
    camera_.id = "r1/fisheye";
    camera_.model.image_width_px = camera_.model.image_height_px = 16;
  }

  void send(bus::FrameWriter& writer, TimeNs time_ns) {
    bus::FrameHeader header;
    header.acquired_ns = time_ns;
    header.width_px = header.height_px = 16;
    header.channels = 3;
    std::uint8_t* pixels = writer.begin(header);
    ASSERT_NE(pixels, nullptr);
    std::fill_n(pixels, header.bytes(), std::uint8_t{7});
    ASSERT_TRUE(writer.publish());
  }

  bus::ServiceContext context(bus::Bus& bus) {
    return {bus, options_, topics_,
            std::make_shared<spdlog::logger>("test", std::make_shared<spdlog::sinks::null_sink_st>())};
  }

  /// Time until the inlet detects the end; empty if it does not within `limit`. @param stopped the camera was
  /// stopped before the announcement
  std::optional<steady_clock::duration> endAfter(TimeNs last, steady_clock::duration limit,
                                                 bool stopped = false) {
    auto writer = camera_bus_->frameWriter(camera_.id, 16 * 16 * 3);
    RunEnds inlet_ends(context(*inlet_bus_)), camera_ends(context(*camera_bus_));
    FrameInlet inlet(context(*inlet_bus_), camera_, inlet_ends);
    bus::StatusBoard status;
    for (TimeNs t = 1; t <= 3; ++t) {
      send(*writer, t);
      EXPECT_TRUE(inlet.take(status));
      EXPECT_TRUE(inlet.release(status));
    }
    EXPECT_FALSE(inlet.ended());
    if (stopped) camera_bus_->requestStop();
    camera_ends.announce("camera r1/fisheye", last, 5);
    const auto begun = steady_clock::now();
    while (steady_clock::now() - begun < limit) {
      inlet_ends.poll();
      if (inlet.ended()) return steady_clock::now() - begun;
    }
    return std::nullopt;
  }

  std::shared_ptr<bus::FakeNetwork> network_;
  std::unique_ptr<bus::Bus> camera_bus_, inlet_bus_;
  bus::Topics topics_;
  bus::ServiceOptions options_;
  fleet::CameraSpec camera_;
};

TEST_P(LostFrames, LiveModeEndsAfterGraceReplayWaitsForFrames) {
  const auto took = endAfter(5, 4 * FrameInlet::kGrace);
  if (GetParam() == bus::RunMode::kLive) {
    ASSERT_TRUE(took);
    EXPECT_GE(*took, FrameInlet::kGrace) << "frames may still arrive";
  } else {
    EXPECT_FALSE(took);
  }
}

TEST_P(LostFrames, EndsAtOnceAfterLastFrame) {
  const auto took = endAfter(3, 4 * FrameInlet::kGrace);
  ASSERT_TRUE(took);
  EXPECT_LT(*took, FrameInlet::kGrace);
}

/// In live mode a stopped camera may be restarted and continue; in replay mode it may not.
TEST_P(LostFrames, StoppedCameraEndsItsStreamOnlyInReplay) {
  EXPECT_EQ(endAfter(3, 2 * FrameInlet::kGrace, true).has_value(), GetParam() == bus::RunMode::kReplay);
}

INSTANTIATE_TEST_SUITE_P(Modes, LostFrames, testing::Values(bus::RunMode::kLive, bus::RunMode::kReplay),
                         [](const auto& mode) {
                           return mode.param == bus::RunMode::kLive ? "Live" : "Replay";
                         });

}  // namespace
}  // namespace omnifleet::services
