// Invalid input is reported and counted and never passed on as valid; the stage continues.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "tests/unit/services/on_fake_bus/stage_bench.h"

namespace omnifleet {
namespace {

using testing::HasSubstr;

constexpr int kWidth = 480, kHeight = 360;  // fisheye of the small arena
constexpr TimeNs kPeriod = 200'000'000;

/// The local mapper of r1 with its camera and wheels.
class LocalMapperStage : public testing::Test {
 protected:
  LocalMapperStage()
      : bench_("local_mapper", "r1"),
        camera_(bench_.bus().frameWriter("r1/fisheye", kWidth * kHeight * 3)),
        wheels_(bench_.bus().writer(bench_.topics.wheels_odometry, "r1")),
        maps_(bench_.bus().reader(bench_.topics.local_map, "r1")) {}

  void sendWheels(TimeNs time, double left, double right) {
    v1::WheelOdometry sample;
    sample.robot("r1");
    sample.header().acquired_ns(time);
    sample.v_left_mps(left);
    sample.v_right_mps(right);
    ASSERT_TRUE(wheels_->write(sample));
  }
  void sendFrame(std::uint32_t index, int width, int height, FrameState state = FrameState::kOk) {
    bus::FrameHeader header;
    header.acquired_ns = index * kPeriod;
    header.sequence = index;
    header.width_px = width;
    header.height_px = height;
    header.state = state;
    std::uint8_t* loan = camera_->begin(header);
    ASSERT_NE(loan, nullptr);
    test::drawBareFloor(loan, header.width_px, header.height_px);
    for (int v = 0; stain_ && v < 22; ++v)
      std::memset(loan + 3 * ((stain_row_ + v) * kWidth + 330), 106, 3 * 22);
    for (int v = 0; object_ && v < 22; ++v) std::memset(loan + 3 * ((170 + v) * kWidth + 330), 20, 3 * 22);
    for (int v = 0; is_enclosed_ && v < height; ++v)
      for (int u = 0; u < width; ++u) paintAround(u, v, loan + 3 * (v * width + u));
    if (is_occluded_) std::memset(loan, 70, header.bytes());
    ASSERT_TRUE(camera_->publish());
  }
  /// Six colours around a narrow strip of floor.
  static void paintAround(int u, int v, std::uint8_t* pixel) {
    const double x = u - 0.5 * (kWidth - 1), y = v - 0.5 * (kHeight - 1);
    if (std::hypot(x, y) < 86.0) return;
    const int sector = static_cast<int>(6.0 * (std::atan2(y, x) + M_PI) / (2.0 * M_PI + 1e-9));
    const std::uint8_t colours[6][3] = {{20, 20, 200},  {20, 200, 20},  {200, 20, 20},
                                        {20, 200, 200}, {200, 20, 200}, {10, 10, 10}};
    std::memcpy(pixel, colours[sector], 3);
  }
  /// Sends one frame. @return state of the stage's answer
  v1::FrameState answerTo(std::uint32_t index, int width, int height, FrameState state = FrameState::kOk) {
    sendFrame(index, width, height, state);
    sendWheels(index * kPeriod, 0.1, 0.1);
    bench_.spin();
    v1::LocalMap answer;
    EXPECT_TRUE(maps_->take(answer)) << "every frame must have an answer";
    EXPECT_EQ(answer.header().sequence_number(), index);
    EXPECT_TRUE(answer.state() == v1::FrameState::FRAME_OK || answer.objects().empty());
    v1::LocalMap none;
    EXPECT_FALSE(maps_->take(none)) << "a frame must have only one answer";
    return answer.state();
  }

  void expectCode(ErrorCode code) {
    const Message error = bench_.status().last_error;
    EXPECT_EQ(error.code, code) << error.text;
  }

  bool object_ = false;       ///< a dark square in the image
  bool is_enclosed_ = false;  ///< obstacles on all sides
  bool is_occluded_ = false;  ///< a uniform grey occluder
  bool stain_ = false;        ///< a square a tenth darker than the floor, within reach
  int stain_row_ = 170;
  test::StageBench bench_;
  std::unique_ptr<bus::FrameWriter> camera_;
  std::unique_ptr<bus::Writer<v1::WheelOdometry>> wheels_;
  std::unique_ptr<bus::Reader<v1::LocalMap>> maps_;
};

TEST_F(LocalMapperStage, RejectsFrameOfAnotherSizeThanCalibration) {
  EXPECT_EQ(answerTo(0, kWidth, kHeight), v1::FrameState::FRAME_OK);
  EXPECT_EQ(answerTo(1, kWidth / 2, kHeight), v1::FrameState::FRAME_WRONG_SIZE);
  expectCode(ErrorCode::kImageSizeMismatch);
  EXPECT_THAT(bench_.status().last_error.text, HasSubstr("frame 1 of camera r1/fisheye"));
  EXPECT_EQ(bench_.status().invalid, 1u);
  EXPECT_EQ(answerTo(2, kWidth, kHeight), v1::FrameState::FRAME_OK);
  EXPECT_EQ(bench_.status().invalid, 1u);
  EXPECT_EQ(bench_.status().processed, 3u);
}

TEST_F(LocalMapperStage, ReportsGapBetweenFrames) {
  for (std::uint32_t index = 0; index < 3; ++index)
    EXPECT_EQ(answerTo(index, kWidth, kHeight), v1::FrameState::FRAME_OK);
  EXPECT_EQ(answerTo(7, kWidth, kHeight), v1::FrameState::FRAME_OK);
  expectCode(ErrorCode::kNone);
  EXPECT_EQ(answerTo(20, kWidth, kHeight), v1::FrameState::FRAME_OK);
  expectCode(ErrorCode::kFrameGap);
  EXPECT_THAT(bench_.status().last_error.text,
              HasSubstr("camera r1/fisheye: no frame for 2.6 s before frame 20"));
  EXPECT_EQ(bench_.messages().size(), 1u);
  EXPECT_EQ(answerTo(21, kWidth, kHeight), v1::FrameState::FRAME_OK);
  EXPECT_TRUE(bench_.messages().empty());
}

TEST_F(LocalMapperStage, ReportsUndecidedRegionAfterTenFrames) {
  std::uint32_t index = 0;
  stain_ = true;
  for (; index < 9; ++index) ASSERT_EQ(answerTo(index, kWidth, kHeight), v1::FrameState::FRAME_OK);
  stain_ = false;
  ASSERT_EQ(answerTo(index++, kWidth, kHeight), v1::FrameState::FRAME_OK);
  expectCode(ErrorCode::kNone);
  stain_ = true;
  ASSERT_EQ(answerTo(index++, kWidth, kHeight), v1::FrameState::FRAME_OK);
  expectCode(ErrorCode::kUndecidedRegions);
  EXPECT_THAT(bench_.status().last_error.text, HasSubstr("camera r1/fisheye"));
}

/// A floor with a strong pattern has many such regions. The first is reported at once, the others together.
TEST_F(LocalMapperStage, ReportsLaterUndecidedRegionsTogether) {
  std::vector<std::pair<std::uint32_t, std::string>> reports;
  for (std::uint32_t index = 0; index < 62; ++index) {
    stain_ = index < 11 || (index >= 22 && index < 33);
    stain_row_ = index < 11 ? 170 : 130;
    ASSERT_EQ(answerTo(index, kWidth, kHeight), v1::FrameState::FRAME_OK);
    for (const Message& message : bench_.messages()) reports.emplace_back(index, message.text);
  }
  ASSERT_EQ(reports.size(), 2u);
  EXPECT_EQ(reports[0].first, 9u);
  EXPECT_THAT(reports[0].second, HasSubstr("frame 9, "));
  EXPECT_EQ(reports[1].first, 59u);
  EXPECT_THAT(reports[1].second, HasSubstr("frame 31, "));
}

TEST_F(LocalMapperStage, ReportsUndecidedRegionAtEndOfShortRun) {
  stain_ = true;
  for (std::uint32_t index = 0; index < 5; ++index)
    ASSERT_EQ(answerTo(index, kWidth, kHeight), v1::FrameState::FRAME_OK);
  expectCode(ErrorCode::kNone);
  const auto ends = bench_.bus().writer(bench_.topics.run_end);
  for (const char* stream : {"camera r1/fisheye", "wheels/odometry r1"}) {
    v1::RunEnd end;
    end.stream(stream);
    end.header().acquired_ns(4 * kPeriod);
    end.samples(5);
    ASSERT_TRUE(ends->write(end));
  }
  bench_.spin();
  expectCode(ErrorCode::kUndecidedRegions);
  EXPECT_THAT(bench_.status().last_error.text, HasSubstr("camera r1/fisheye"));
}

TEST_F(LocalMapperStage, ReportsHiddenFloorAfterTenFrames) {
  is_enclosed_ = true;
  for (std::uint32_t index = 0; index < 9; ++index) answerTo(index, kWidth, kHeight);
  expectCode(ErrorCode::kNone);
  answerTo(9, kWidth, kHeight);
  expectCode(ErrorCode::kFloorHidden);
  EXPECT_THAT(bench_.status().last_error.text, HasSubstr("camera r1/fisheye"));
  EXPECT_THAT(bench_.status().last_error.text, HasSubstr("self_mask_radius_px"));
}

/// The wheels roll 2 cm between two frames.
TEST_F(LocalMapperStage, RejectsFramesOfFrozenCamera) {
  object_ = true;
  EXPECT_EQ(answerTo(0, kWidth, kHeight), v1::FrameState::FRAME_OK);
  EXPECT_EQ(answerTo(1, kWidth, kHeight), v1::FrameState::FRAME_OK);
  EXPECT_EQ(answerTo(2, kWidth, kHeight), v1::FrameState::FRAME_OUT_OF_ORDER);
  EXPECT_EQ(answerTo(3, kWidth, kHeight), v1::FrameState::FRAME_OUT_OF_ORDER);
  expectCode(ErrorCode::kImageFrozen);
  EXPECT_EQ(bench_.status().invalid, 2u);
  stain_ = true;
  object_ = false;
  EXPECT_EQ(answerTo(4, kWidth, kHeight), v1::FrameState::FRAME_OK);
}

TEST_F(LocalMapperStage, RejectsFramesOfOccludedLens) {
  object_ = true;
  EXPECT_EQ(answerTo(0, kWidth, kHeight), v1::FrameState::FRAME_OK);
  is_occluded_ = true;
  EXPECT_EQ(answerTo(1, kWidth, kHeight), v1::FrameState::FRAME_DARK);
  EXPECT_EQ(answerTo(2, kWidth, kHeight), v1::FrameState::FRAME_DARK);
  expectCode(ErrorCode::kLensOccluded);
  EXPECT_EQ(bench_.status().invalid, 2u);
  is_occluded_ = false;
  EXPECT_EQ(answerTo(3, kWidth, kHeight), v1::FrameState::FRAME_OK);
}

TEST_F(LocalMapperStage, RejectsFramesOfLensOccludedFromFirstFrame) {
  is_occluded_ = true;
  for (std::uint32_t index = 0; index < 3; ++index)
    EXPECT_EQ(answerTo(index, kWidth, kHeight), v1::FrameState::FRAME_DARK);
  expectCode(ErrorCode::kLensOccluded);
  EXPECT_EQ(bench_.status().invalid, 3u);
  is_occluded_ = false;
  EXPECT_EQ(answerTo(3, kWidth, kHeight), v1::FrameState::FRAME_OK);
}

TEST_F(LocalMapperStage, RejectsEmptyFrame) {
  EXPECT_EQ(answerTo(0, 0, 0), v1::FrameState::FRAME_EMPTY);
  EXPECT_EQ(bench_.status().invalid, 1u);
}

TEST_F(LocalMapperStage, RejectsFrameThatCameraCouldNotRead) {
  EXPECT_EQ(answerTo(0, kWidth, kHeight, FrameState::kMissing), v1::FrameState::FRAME_MISSING);
  EXPECT_EQ(answerTo(1, kWidth, kHeight, FrameState::kUnreadable), v1::FrameState::FRAME_UNREADABLE);
  EXPECT_EQ(bench_.status().invalid, 2u);
}

TEST_F(LocalMapperStage, RejectsNonFiniteWheelSpeeds) {
  EXPECT_EQ(answerTo(0, kWidth, kHeight), v1::FrameState::FRAME_OK);
  sendWheels(kPeriod / 2, std::numeric_limits<double>::quiet_NaN(), 0.1);
  sendWheels(kPeriod / 2 + 1, 0.1, std::numeric_limits<double>::infinity());
  bench_.spin();
  EXPECT_EQ(bench_.status().drops, 2u);
  expectCode(ErrorCode::kSampleRejected);
  EXPECT_THAT(bench_.status().last_error.text, HasSubstr("wheels/odometry r1"));
  sendFrame(1, kWidth, kHeight);
  sendWheels(kPeriod, 0.1, 0.1);
  bench_.spin();
  v1::LocalMap answer;
  ASSERT_TRUE(maps_->take(answer));
  // 0.1 m/s straight ahead for 0.2 s: the rejected samples must have no effect.
  EXPECT_TRUE(answer.motion().valid());
  EXPECT_NEAR(answer.motion().left_m(), 0.02, 1e-9);
  EXPECT_NEAR(answer.motion().right_m(), 0.02, 1e-9);
}

/// Finite, but faster than any robot of this kind.
TEST_F(LocalMapperStage, RejectsImpossibleWheelSpeeds) {
  sendWheels(0, 1e300, 0.1);
  sendWheels(1, 0.1, -21.0);
  bench_.spin();
  EXPECT_EQ(bench_.status().drops, 2u);
}

/// The classifier of r1, which receives a local map with a non-finite number.
TEST(ClassifierStage, RejectsObjectWithNonFinitePosition) {
  test::StageBench bench("classifier", "r1");
  auto maps = bench.bus().writer(bench.topics.local_map, "r1");
  auto objects = bench.bus().reader(bench.topics.objects, "r1");
  v1::LocalMap map;
  map.robot("r1");
  map.state(v1::FrameState::FRAME_OK);
  map.camera_height_m(0.5);
  map.objects().resize(1);
  map.objects()[0].centroid().x(std::numeric_limits<double>::quiet_NaN());
  ASSERT_TRUE(maps->write(map));
  bench.spin();
  EXPECT_EQ(bench.status().drops, 1u);
  EXPECT_EQ(bench.status().last_error.code, ErrorCode::kSampleRejected);
  EXPECT_THAT(bench.status().last_error.text, HasSubstr("local_map r1"));
  v1::Objects out;
  ASSERT_TRUE(objects->take(out)) << "the frame must keep its place in the stream";
  EXPECT_EQ(out.state(), v1::FrameState::FRAME_NON_FINITE);
  EXPECT_TRUE(out.tracks().empty());
}

}  // namespace
}  // namespace omnifleet
