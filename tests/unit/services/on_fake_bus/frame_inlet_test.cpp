// The end of a camera's frames, also where the last of them were lost.

#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>

#include "common/frame_inlet.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet::services {
namespace {

using std::chrono::steady_clock;

/// A camera that says that it gave five frames, of which three came.
class LostFrames : public testing::TestWithParam<bus::RunMode> {
 protected:
  LostFrames()
      : network_(bus::makeFakeNetwork()),
        theirs_(bus::makeFakeBus(network_, {})),
        mine_(bus::makeFakeBus(network_, {})),
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

  /// How long the inlet took to see the end; empty when it does not within `limit`.
  /// @param stopped the camera has been told to stop before it says so
  std::optional<steady_clock::duration> endAfter(TimeNs last, steady_clock::duration limit,
                                                 bool stopped = false) {
    auto writer = theirs_->frameWriter(camera_.id, 16 * 16 * 3);
    RunEnds mine(context(*mine_)), theirs(context(*theirs_));
    FrameInlet inlet(context(*mine_), camera_, mine);
    bus::StatusBoard status;
    for (TimeNs t = 1; t <= 3; ++t) {
      send(*writer, t);
      EXPECT_TRUE(inlet.take(status));
      EXPECT_TRUE(inlet.release(status));
    }
    EXPECT_FALSE(inlet.ended());
    if (stopped) theirs_->requestStop();
    theirs.announce("camera r1/fisheye", last, 5);
    const auto begun = steady_clock::now();
    while (steady_clock::now() - begun < limit) {
      mine.poll();
      if (inlet.ended()) return steady_clock::now() - begun;
    }
    return std::nullopt;
  }

  std::shared_ptr<bus::FakeNetwork> network_;
  std::unique_ptr<bus::Bus> theirs_, mine_;
  bus::Topics topics_;
  bus::ServiceOptions options_;
  fleet::CameraSpec camera_;
};

TEST_P(LostFrames, TheEndIsSeenLiveAndWaitedForWhereNothingMayBeLost) {
  const auto took = endAfter(5, 4 * FrameInlet::kGrace);
  if (GetParam() == bus::RunMode::kLive) {
    ASSERT_TRUE(took);
    EXPECT_GE(*took, FrameInlet::kGrace) << "frames may be on their way";
  } else {
    EXPECT_FALSE(took);
  }
}

TEST_P(LostFrames, TheEndIsSeenAtOnceWhereTheLastFrameCame) {
  const auto took = endAfter(3, 4 * FrameInlet::kGrace);
  ASSERT_TRUE(took);
  EXPECT_LT(*took, FrameInlet::kGrace);
}

/// Live it may be started again, and its frames go on; where nothing may be lost it may not.
TEST_P(LostFrames, WhoIsStoppedEndsHisStreamWhereNobodyStartsHimAgain) {
  EXPECT_EQ(endAfter(3, 2 * FrameInlet::kGrace, true).has_value(), GetParam() == bus::RunMode::kReplay);
}

INSTANTIATE_TEST_SUITE_P(Modes, LostFrames, testing::Values(bus::RunMode::kLive, bus::RunMode::kReplay),
                         [](const auto& mode) {
                           return mode.param == bus::RunMode::kLive ? "Live" : "Replay";
                         });

}  // namespace
}  // namespace omnifleet::services
