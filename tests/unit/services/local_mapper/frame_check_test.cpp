#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "local_mapper/frame_check.h"
#include "tests/unit/services/local_mapper/fisheye_scene.h"

namespace omnifleet::local_mapper {
namespace {

class FrameCheckTest : public ::testing::Test {
 protected:
  FrameCheckTest()
      : camera_(testing::fisheyeModel()), view_(camera_, {}), check_(camera_.model(), view_.mask(), {}) {}

  static cv::Mat grey(int level) { return cv::Mat(480, 640, CV_8UC1, cv::Scalar(level)); }
  FrameState stateOf(const cv::Mat& image, std::uint32_t sequence) {
    return check_.check(testing::frameOf(image, sequence));
  }

  lens::Camera camera_;
  ground::FloorView view_;
  FrameCheck check_;
};

TEST_F(FrameCheckTest, ReportsReasonOfRejection) {
  EXPECT_EQ(stateOf({}, 0), FrameState::kEmpty);
  EXPECT_EQ(stateOf(cv::Mat(480, 641, CV_8UC1, cv::Scalar(100)), 1), FrameState::kWrongSize);
  EXPECT_EQ(stateOf(cv::Mat(480, 640, CV_32FC1, cv::Scalar(100)), 2), FrameState::kWrongSize);
  EXPECT_EQ(stateOf(grey(3), 3), FrameState::kDark);
  EXPECT_EQ(stateOf(grey(255), 4), FrameState::kOverexposed);
  EXPECT_EQ(stateOf(grey(100), 5), FrameState::kOk);
  EXPECT_EQ(stateOf(cv::Mat(480, 640, CV_8UC3, cv::Scalar(100, 90, 80)), 6), FrameState::kOk);
  Frame torn = testing::frameOf(grey(100), 7);
  torn.state = FrameState::kUnreadable;
  EXPECT_EQ(check_.check(torn), FrameState::kUnreadable);
}

TEST_F(FrameCheckTest, MeasuresExposureOnFloorPixelsOnly) {
  cv::Mat image = grey(255);
  image.setTo(cv::Scalar(120), view_.mask());
  EXPECT_EQ(stateOf(image, 0), FrameState::kOk);
  image.setTo(cv::Scalar(0), view_.mask());
  EXPECT_EQ(stateOf(image, 1), FrameState::kDark);
}

TEST_F(FrameCheckTest, DetectsLightBeyondOrthographicLens) {
  lens::CameraModel model = camera_.model();
  model.projection = lens::Projection::kOrthographic;
  model.focal_px = {190.0, 190.0};
  const lens::Camera lens(model);
  const ground::FloorView view(lens, {});
  cv::Mat disc = grey(0);
  cv::circle(disc, {cvRound(model.principal_point_px.x()), cvRound(model.principal_point_px.y())}, 190,
             cv::Scalar(100), cv::FILLED);
  FrameCheck right(lens.model(), view.mask(), {}), wrong(lens.model(), view.mask(), {});
  EXPECT_EQ(right.check(testing::frameOf(disc, 0)), FrameState::kOk);
  EXPECT_EQ(right.litBeyondLens(), 0.0);
  EXPECT_EQ(wrong.check(testing::frameOf(grey(3), 0)), FrameState::kDark);
  EXPECT_EQ(wrong.litBeyondLens(), 0.0) << "a dark frame shows nothing";
  EXPECT_EQ(wrong.check(testing::frameOf(grey(100), 1)), FrameState::kOk);
  EXPECT_EQ(wrong.litBeyondLens(), 1.0);
  stateOf(grey(100), 0);
  EXPECT_EQ(check_.litBeyondLens(), 0.0) << "only tested for orthographic lenses";
}

TEST_F(FrameCheckTest, FollowsOnlyDirectUsablePredecessors) {
  stateOf(grey(100), 0);
  EXPECT_FALSE(check_.follows());  // the first frame
  stateOf(grey(100), 1);
  EXPECT_TRUE(check_.follows());
  stateOf(grey(100), 3);
  EXPECT_FALSE(check_.follows());  // a frame is missing
  stateOf(grey(100), 4);
  EXPECT_TRUE(check_.follows());
  stateOf(grey(2), 5);
  EXPECT_FALSE(check_.follows());  // occluded
  stateOf(grey(100), 6);
  EXPECT_FALSE(check_.follows());  // after the occluded frame
  stateOf(grey(100), 7);
  EXPECT_TRUE(check_.follows());
}

TEST_F(FrameCheckTest, RejectsDoubledAndLateFrames) {
  stateOf(grey(100), 5);
  EXPECT_EQ(stateOf(grey(100), 5), FrameState::kOutOfOrder);
  EXPECT_EQ(stateOf(grey(100), 2), FrameState::kOutOfOrder);
  Frame again = testing::frameOf(grey(100), 5);
  again.acquired_ns += 1000;
  EXPECT_EQ(check_.check(again), FrameState::kOutOfOrder)
      << "no camera takes two frames within a microsecond";
  EXPECT_EQ(stateOf(grey(100), 6), FrameState::kOk);
  EXPECT_FALSE(check_.follows());
  EXPECT_EQ(stateOf(grey(100), 7), FrameState::kOk);
  EXPECT_TRUE(check_.follows());
}

TEST_F(FrameCheckTest, ReportsLongPauseAsGap) {
  Frame first = testing::frameOf(grey(100), 0), second = testing::frameOf(grey(100), 1);
  second.acquired_ns = first.acquired_ns + 3000000000LL;
  check_.check(first);
  EXPECT_EQ(check_.gap_s(), 0.0);
  EXPECT_EQ(check_.check(second), FrameState::kOk);
  EXPECT_FALSE(check_.follows());
  EXPECT_NEAR(check_.gap_s(), 3.0, 1e-9);
}

/// Rows that were removed from a recording leave no gap in the sequence numbers, and may last less than a
/// second in all.
TEST_F(FrameCheckTest, DetectsGapRelativeToPreviousIntervals) {
  Frame frame = testing::frameOf(grey(100), 0);
  const auto after = [&](double seconds) {
    frame.acquired_ns += static_cast<TimeNs>(1e9 * seconds);
    ++frame.sequence;
    EXPECT_EQ(check_.check(frame), FrameState::kOk);
    return check_.follows();
  };
  check_.check(frame);
  for (const double seconds : {0.2, 0.21, 0.15, 0.3, 0.2, 0.4}) EXPECT_TRUE(after(seconds)) << seconds;
  EXPECT_FALSE(after(1.0));
  EXPECT_TRUE(after(0.2));
  for (int k = 0; k < 9; ++k) after(0.8);  // becomes the usual interval
  EXPECT_TRUE(after(0.8));
}

}  // namespace
}  // namespace omnifleet::local_mapper
