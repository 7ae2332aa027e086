#include <gtest/gtest.h>

#include <opencv2/imgproc.hpp>
#include <random>

#include "ground/blob_splitter.h"

namespace omnifleet::ground {
namespace {

const cv::Scalar kRed(30, 40, 190), kBlue(180, 80, 30), kYellow(30, 190, 210);

class BlobSplitterTest : public ::testing::Test {
 protected:
  BlobSplitterTest() : image_(200, 200, cv::Vec3b(150, 160, 170)), region_(200, 200, std::uint8_t{0}) {}

  void draw(const cv::Rect& rect, const cv::Scalar& colour) {
    cv::rectangle(image_, rect, colour, cv::FILLED);
    cv::rectangle(region_, rect, 255, cv::FILLED);
  }
  /// Varies the brightness over the surfaces by a third and adds noise of 3 grey levels.
  void roughen() {
    std::mt19937 random(5);
    std::normal_distribution<double> noise(0.0, 3.0);
    for (int y = 0; y < image_.rows; ++y) {
      for (int x = 0; x < image_.cols; ++x) {
        const double light = 1.0 + 0.33 * std::sin(0.2 * x) * std::sin(0.3 * y);
        for (int c = 0; c < 3; ++c)
          image_(y, x)[c] = cv::saturate_cast<std::uint8_t>(image_(y, x)[c] * light + noise(random));
      }
    }
  }
  Blob whole() const {
    Blob blob;
    blob.label = 7;
    blob.area_px = cv::countNonZero(region_);
    blob.rect = cv::boundingRect(region_);
    for (int y = 0; y < region_.rows; ++y) {
      for (int x = 0; x < region_.cols;) {
        const int begin = x;
        while (x < region_.cols && region_(y, x) != 0) ++x;
        if (x > begin) blob.runs.push_back({y, begin, x});
        ++x;
      }
    }
    return blob;
  }

  cv::Mat3b image_;
  cv::Mat1b region_;
};

TEST_F(BlobSplitterTest, SplitsTwoObjectsAtTheirColourBorder) {
  draw({60, 40, 50, 40}, kBlue);
  draw({90, 70, 40, 50}, kRed);  // in front
  roughen();
  BlobSplitter splitter(image_.size(), {});
  const auto& parts = splitter.split(image_, whole());
  ASSERT_EQ(parts.size(), 2U);
  const Blob& blue = parts[0].rect.y < parts[1].rect.y ? parts[0] : parts[1];
  const Blob& red = parts[0].rect.y < parts[1].rect.y ? parts[1] : parts[0];
  EXPECT_NEAR(blue.area_px, 50 * 40 - 20 * 10,
              60);  // one pixel along the common border of 30 px, and corners
  EXPECT_NEAR(red.area_px, 40 * 50, 60);
  EXPECT_EQ(red.label, 7);
  EXPECT_EQ(cv::countNonZero(splitter.mask()), whole().area_px);
  EXPECT_NE(splitter.mask()(45, 65), splitter.mask()(110, 120));
  EXPECT_EQ(splitter.mask()(5, 5), 0);
}

TEST_F(BlobSplitterTest, IgnoresSpecksConnectedByACorner) {
  draw({60, 40, 50, 40}, kBlue);
  draw({90, 70, 40, 50}, kRed);
  draw({59, 39, 1, 1}, kBlue);
  draw({130, 120, 1, 1}, kRed);
  draw({131, 121, 2, 1}, kYellow);
  roughen();
  BlobSplitter splitter(image_.size(), {});
  const auto& parts = splitter.split(image_, whole());
  ASSERT_EQ(parts.size(), 2U);
  for (const Blob& part : parts) EXPECT_GT(part.area_px, 1000);
}

TEST_F(BlobSplitterTest, SplitsObjectThatIsDeeplyOccluded) {
  draw({70, 90, 60, 30}, kRed);
  draw({80, 60, 40, 45}, kBlue);  // in front, overlaps the other one deeply
  roughen();
  BlobSplitter splitter(image_.size(), {});
  const auto& parts = splitter.split(image_, whole());
  ASSERT_EQ(parts.size(), 2U);
  EXPECT_NEAR(std::max(parts[0].area_px, parts[1].area_px), 40 * 45, 80);
  EXPECT_NEAR(std::min(parts[0].area_px, parts[1].area_px), 60 * 30 - 40 * 15, 80);
}

TEST_F(BlobSplitterTest, KeepsObjectWithMarksWhole) {
  draw({60, 40, 60, 60}, kRed);
  cv::rectangle(image_, cv::Rect(75, 55, 30, 20), kYellow, cv::FILLED);  // within
  cv::rectangle(image_, cv::Rect(60, 85, 60, 15), kBlue, cv::FILLED);    // a stripe to the edge
  roughen();
  BlobSplitter splitter(image_.size(), {});
  EXPECT_TRUE(splitter.split(image_, whole()).empty());
  EXPECT_EQ(cv::countNonZero(splitter.mask()), 0);
}

TEST_F(BlobSplitterTest, KeepsConcaveObjectOfOneColourWhole) {
  draw({60, 40, 50, 40}, kBlue);
  draw({90, 70, 40, 50}, kBlue);
  roughen();
  BlobSplitter splitter(image_.size(), {});
  EXPECT_TRUE(splitter.split(image_, whole()).empty());
}

TEST_F(BlobSplitterTest, CarriesNothingOverToTheNextRegion) {
  draw({60, 40, 50, 40}, kBlue);
  draw({90, 70, 40, 50}, kRed);
  BlobSplitter splitter(image_.size(), {});
  const auto first = splitter.split(image_, whole());
  const cv::Mat1b mask = splitter.mask().clone();
  Blob tiny;
  tiny.area_px = 1;
  EXPECT_TRUE(splitter.split(image_, tiny).empty());
  EXPECT_EQ(cv::countNonZero(splitter.mask()), 0);
  EXPECT_EQ(splitter.split(image_, whole()).size(), first.size());
  EXPECT_EQ(cv::countNonZero(splitter.mask() != mask), 0);
}

TEST(SplitOptions, RejectsValuesOutOfRange) {
  EXPECT_THROW(SplitOptions::read(options::Section::parse("max_solidity: 1.5", "t.yaml")), options::Error);
  EXPECT_EQ(SplitOptions::read(options::Section::parse("enabled: false", "t.yaml")).enabled, false);
}

}  // namespace
}  // namespace omnifleet::ground
