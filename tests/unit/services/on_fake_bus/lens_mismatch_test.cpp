// A wrong lens is the lasting problem of its camera. What follows from it is not reported beside it.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <fstream>

#include "tests/test_data.h"
#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

using testing::HasSubstr;

constexpr int kWidth_px = 480, kHeight_px = 360;  // fisheye of the small arena
constexpr TimeNs kPeriod_ns = 200'000'000;

/// The local mapper of r1, whose image ends at 130 px. Its sensor.yaml says 185°, 180 px.
class WrongLens : public testing::Test {
 protected:
  explicit WrongLens(const std::string& options = "") {
    const std::string source = std::getenv("OMNIFLEET_SOURCE_DIR");
    const std::string fleet = folder_ / "fleet.yaml";
    std::ofstream(fleet) << "name: small\nworld: {arena: " << source
                         << "/config/arenas/small.yaml, seed: 1}\n"
                         << options;
    bench_ = std::make_unique<test::StageBench>("local_mapper", "r1", "", fleet);
    camera_ = bench_->bus().frameWriter("r1/fisheye", kWidth_px * kHeight_px * 3);
    wheels_ = bench_->bus().writer(bench_->topics.wheels_odometry, "r1");
    maps_ = bench_->bus().reader(bench_->topics.local_map, "r1");
  }

  /// Sends one frame and keeps the codes of the messages for it.
  void frame(std::uint32_t index, double radius_px, int width = kWidth_px) {
    bus::FrameHeader header;
    header.acquired_ns = index * kPeriod_ns;
    header.sequence = index;
    header.width_px = width;
    header.height_px = kHeight_px;
    std::uint8_t* loan = camera_->begin(header);
    ASSERT_NE(loan, nullptr);
    test::drawBareFloor(loan, width, kHeight_px);
    for (int v = 0; v < kHeight_px; ++v)
      for (int u = 0; u < width; ++u)
        if (std::hypot(u - 0.5 * (width - 1), v - 0.5 * (kHeight_px - 1)) > radius_px)
          std::memset(loan + 3 * (v * width + u), 0, 3);
    ASSERT_TRUE(camera_->publish());
    v1::WheelOdometry wheels;
    wheels.robot("r1");
    wheels.header().acquired_ns(index * kPeriod_ns);
    wheels.v_left_mps(0.1);
    wheels.v_right_mps(0.1);
    ASSERT_TRUE(wheels_->write(wheels));
    bench_->spin();
    v1::LocalMap answer;
    EXPECT_TRUE(maps_->take(answer));
    for (const Message& message : bench_->messages()) codes_.push_back(message.code);
  }

  long count(ErrorCode code) const { return std::count(codes_.begin(), codes_.end(), code); }

  test::TempFolder folder_;
  std::unique_ptr<test::StageBench> bench_;
  std::unique_ptr<bus::FrameWriter> camera_;
  std::unique_ptr<bus::Writer<v1::WheelOdometry>> wheels_;
  std::unique_ptr<bus::Reader<v1::LocalMap>> maps_;
  std::vector<ErrorCode> codes_;
};

class UncheckedLens : public WrongLens {
 protected:
  UncheckedLens() : WrongLens("services: {local_mapper: {image_circle: {frames: 0}}}\n") {}
};

TEST_F(WrongLens, IsTheLastingProblemOfTheCamera) {
  for (std::uint32_t index = 0; index < 4; ++index) {
    frame(index, 130.0);
    const auto status = bench_->status();
    EXPECT_EQ(status.state, bus::ServiceState::kDegraded) << index;
    EXPECT_EQ(status.last_error.code, ErrorCode::kLensMismatch) << index;
  }
  EXPECT_EQ(count(ErrorCode::kLensMismatch), 1);
  frame(4, 130.0, kWidth_px / 2);
  EXPECT_EQ(count(ErrorCode::kImageSizeMismatch), 1) << "other problems are logged";
  const auto status = bench_->status();
  EXPECT_EQ(status.state, bus::ServiceState::kDegraded);
  EXPECT_EQ(status.last_error.code, ErrorCode::kLensMismatch) << "and do not replace it in the status";
  EXPECT_THAT(status.last_error.text, HasSubstr("camera r1/fisheye: the image ends 130 px from its centre"));
}

TEST_F(WrongLens, IsNotReportedAsDirt) {
  for (std::uint32_t index = 0; index < 12; ++index) frame(index, 130.0);
  EXPECT_EQ(count(ErrorCode::kLensMismatch), 1);
  EXPECT_EQ(count(ErrorCode::kLensOccluded), 0);
  EXPECT_EQ(count(ErrorCode::kFloorOnly), 0);
}

/// Without the check the dark rim is taken for an occluded part of the view.
TEST_F(UncheckedLens, IsTakenForDirt) {
  for (std::uint32_t index = 0; index < 4; ++index) frame(index, 130.0);
  EXPECT_EQ(count(ErrorCode::kLensMismatch), 0);
  EXPECT_EQ(count(ErrorCode::kLensOccluded), 1);
}

/// The rim of 4 px at the border of the image and the true circle are no problem.
TEST_F(WrongLens, IsNotFoundInTheRightImage) {
  for (std::uint32_t index = 0; index < 4; ++index) frame(index, 176.0);
  EXPECT_EQ(count(ErrorCode::kLensMismatch), 0);
  EXPECT_EQ(bench_->status().state, bus::ServiceState::kRunning);
}

}  // namespace
}  // namespace omnifleet
