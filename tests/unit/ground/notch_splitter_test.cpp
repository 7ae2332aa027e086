#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>

#include "ground/notch_splitter.h"
#include "tests/unit/ground/bits.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground {
namespace {

/// One region that consists of several shapes, with the outline of its pixels.
class NotchSplitterTest : public ::testing::Test {
 protected:
  NotchSplitterTest()
      : camera_(testing::fisheye()),
        view_(camera_, ViewOptions{}),
        tracer_(view_, rough()),
        splitter_(view_, {}),
        region_(480, 640, std::uint8_t{0}) {}

  static ContourOptions rough() {
    ContourOptions options;
    options.refine = false;
    return options;
  }
  void disc(int u, int v, int radius) { cv::circle(region_, {u, v}, radius, 255, cv::FILLED); }
  void box(const cv::Rect& rect) { cv::rectangle(region_, rect, 255, cv::FILLED); }

  const std::vector<Blob>& split() {
    const testing::Bits bits(region_);
    const auto& blobs = labeller_.label(bits.mask, bits.area, 1);
    EXPECT_EQ(blobs.size(), 1U);
    blob_ = blobs.front();
    const cv::Mat3f floor(view_.cells(), cv::Vec3f(160, 160, 160));
    tracer_.trace({region_, region_, region_, floor, 0.0f}, blob_, contour_);
    return splitter_.split(blob_, contour_);
  }

  lens::Camera camera_;
  FloorView view_;
  ContourTracer tracer_;
  NotchSplitter splitter_;
  Labeller labeller_;
  cv::Mat1b region_;
  Blob blob_;
  Contour contour_;
};

TEST_F(NotchSplitterTest, SplitsTouchingObjectsAtTheNeck) {
  disc(480, 200, 20);
  const int first = cv::countNonZero(region_);
  region_.setTo(0);
  disc(516, 200, 17);
  const int second = cv::countNonZero(region_);
  disc(480, 200, 20);
  const auto& parts = split();
  ASSERT_EQ(parts.size(), 2U);
  // The shapes share a lens two pixels deep, and half of the neck's pixels.
  EXPECT_NEAR(std::max(parts[0].area_px, parts[1].area_px), first, 25);
  EXPECT_NEAR(std::min(parts[0].area_px, parts[1].area_px), second, 25);
  for (const Blob& part : parts) EXPECT_EQ(part.label, blob_.label);
  EXPECT_EQ(parts[0].area_px + parts[1].area_px, blob_.area_px);
  EXPECT_NE(splitter_.mask()(200, 465), splitter_.mask()(200, 530));
  EXPECT_EQ(cv::countNonZero(splitter_.mask()), blob_.area_px);
}

TEST_F(NotchSplitterTest, SplitsOccludedObjectFromNotchToNotch) {
  box({460, 190, 60, 40});
  box({475, 165, 26, 30});
  const auto& parts = split();
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_NEAR(std::max(parts[0].area_px, parts[1].area_px), 60 * 40, 70);
  EXPECT_NEAR(std::min(parts[0].area_px, parts[1].area_px), 26 * 25, 70);
}

TEST_F(NotchSplitterTest, SplitsThreeObjectsInARow) {
  disc(470, 200, 14);
  disc(496, 200, 14);
  disc(522, 200, 14);
  EXPECT_EQ(split().size(), 3U);
}

TEST_F(NotchSplitterTest, KeepsConvexAndRaggedObjectsWhole) {
  disc(480, 200, 20);
  EXPECT_TRUE(split().empty());
  region_.setTo(0);
  box({460, 180, 50, 40});
  for (int x = 462; x < 508; x += 6) region_(cv::Rect(x, 180, 2, 2)).setTo(0);  // a rough edge
  EXPECT_TRUE(split().empty());
  EXPECT_EQ(cv::countNonZero(splitter_.mask()), 0);  // nothing remains of the previous region
}

TEST_F(NotchSplitterTest, IgnoresSliver) {
  box({460, 180, 60, 40});
  box({485, 172, 4, 8});  // 32 px
  EXPECT_TRUE(split().empty());
}

TEST(NotchOptions, ReadsValueAndRejectsOutOfRange) {
  EXPECT_DOUBLE_EQ(NotchOptions::read(options::Section::parse("min_gain: 0.8\n", "o.yaml")).min_gain, 0.8);
  EXPECT_THROW(NotchOptions::read(options::Section::parse("min_gain: 1.2\n", "o.yaml")), options::Error);
}

}  // namespace
}  // namespace omnifleet::ground
