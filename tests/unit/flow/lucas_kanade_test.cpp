#include <gtest/gtest.h>

#include <opencv2/video/tracking.hpp>

#include "flow/lucas_kanade.h"
#include "tests/unit/flow/cells.h"
#include "tests/unit/flow/texture.h"

namespace omnifleet::flow {
namespace {

std::vector<Eigen::Vector2f> lattice(const cv::Mat1b& image, int margin) {
  std::vector<Eigen::Vector2f> points;
  for (int y = margin; y < image.rows - margin; y += 25)
    for (int x = margin; x < image.cols - margin; x += 25)
      points.emplace_back(static_cast<float>(x), static_cast<float>(y));
  return points;
}

struct Result {
  double rms = 0.0;
  int lost = 0;
};

Result ownResult(const cv::Mat1b& a, const cv::Mat1b& b, const Eigen::Vector2f& motion,
                 const LucasKanadeOptions& options) {
  Pyramid from(options.levels), to(options.levels);
  from.build(a);
  to.build(b);
  LucasKanade tracker(options);
  Result result;
  int n = 0;
  for (const auto& p : lattice(a, 60)) {
    Eigen::Vector2f q = p;
    if (!tracker.followBothWays(from, to, p, q)) {
      ++result.lost;
      continue;
    }
    result.rms += (q - p - motion).squaredNorm();
    ++n;
  }
  result.rms = std::sqrt(result.rms / std::max(1, n));
  return result;
}

Result openCvResult(const cv::Mat1b& a, const cv::Mat1b& b, const Eigen::Vector2f& motion, int side) {
  std::vector<cv::Point2f> points, found;
  for (const auto& p : lattice(a, 60)) points.emplace_back(p.x(), p.y());
  std::vector<std::uint8_t> status;
  std::vector<float> error;
  cv::calcOpticalFlowPyrLK(a, b, points, found, status, error, {side, side}, 3);
  Result result;
  int n = 0;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (status[i] == 0) {
      ++result.lost;
      continue;
    }
    const cv::Point2f d = found[i] - points[i] - cv::Point2f(motion.x(), motion.y());
    result.rms += d.dot(d);
    ++n;
  }
  result.rms = std::sqrt(result.rms / std::max(1, n));
  return result;
}

TEST(LucasKanade, TracksKnownMotionAsWellAsOpenCv) {
  const testing::Texture texture(8.0, 5);
  LucasKanadeOptions options;
  options.radius_px = 6;
  options.sigma_px = 3.5;
  options.levels = 4;
  for (const Eigen::Vector2f& motion :
       {Eigen::Vector2f(0.3f, -0.6f), Eigen::Vector2f(4.25f, 2.5f), Eigen::Vector2f(-14.3f, 9.7f)}) {
    const cv::Mat1b a = texture.image(320, 240), b = texture.image(320, 240, motion.x(), motion.y());
    const Result own = ownResult(a, b, motion, options);
    const Result reference = openCvResult(a, b, motion, 2 * options.radius_px + 1);
    EXPECT_LE(own.lost, reference.lost + 1) << motion.transpose();
    EXPECT_LT(own.rms, 0.04) << motion.transpose();  // 8-bit rounding, plus a last step of up to 0.02 px
    EXPECT_LT(own.rms, 1.5 * reference.rms + 0.005) << motion.transpose();
  }
}

/// The range equals that of a pyramid with all levels smoothed.
TEST(LucasKanade, TracksLargeMotionWithCellLevels) {
  const testing::Texture texture(8.0, 5);
  LucasKanadeOptions options;
  const Eigen::Vector2f motion(-14.3f, 9.7f);
  const cv::Mat1b a = texture.image(320, 240), b = texture.image(320, 240, motion.x(), motion.y());
  const std::vector<cv::Rect> all{{0, 0, a.cols, a.rows}};
  const testing::Cells of_a(a), of_b(b);
  Pyramid from(options.levels), to(options.levels), fine_from(2), fine_to(2);
  from.build(a, all, of_a.colours(), all);
  to.build(b, all, of_b.colours(), all);
  fine_from.build(a);
  fine_to.build(b);
  LucasKanade tracker(options);
  int points = 0, lost = 0, lost_without = 0;
  for (const auto& p : lattice(a, 60)) {
    ++points;
    Eigen::Vector2f q = p;
    lost += tracker.followBothWays(from, to, p, q) && (q - p - motion).norm() < 0.2f ? 0 : 1;
    q = p;
    lost_without +=
        tracker.followBothWays(fine_from, fine_to, p, q) && (q - p - motion).norm() < 0.2f ? 0 : 1;
  }
  const Result smoothed = ownResult(a, b, motion, options);
  EXPECT_LE(lost, smoothed.lost + 2);
  EXPECT_LT(lost, points / 4);
  EXPECT_GT(lost_without, points / 2);
}

TEST(LucasKanade, TracksFromInitialGuessWithoutPyramid) {
  const testing::Texture texture(8.0, 6);
  const Eigen::Vector2f motion(31.0f, -22.5f);
  const cv::Mat1b a = texture.image(320, 240), b = texture.image(320, 240, motion.x(), motion.y());
  LucasKanadeOptions options;
  options.levels = 1;
  Pyramid from(1), to(1);
  from.build(a);
  to.build(b);
  LucasKanade tracker(options);
  const Eigen::Vector2f p(150.0f, 120.0f);
  Eigen::Vector2f q = p + motion + Eigen::Vector2f(0.8f, -0.7f);
  ASSERT_TRUE(tracker.follow(from, to, p, q));
  EXPECT_LT((q - p - motion).norm(), 0.05f);
}

TEST(LucasKanade, FollowsCentreOfWindowWithGaussianWeights) {
  // Left of u = 160 the scene is static, right of it it moves by 2 px. Near the seam equal weights mix both
  // motions.
  const testing::Texture still(8.0, 7), moving(8.0, 8);
  cv::Mat1b a = still.image(320, 240), b = a.clone();
  moving.image(320, 240)(cv::Rect(160, 0, 160, 240)).copyTo(a(cv::Rect(160, 0, 160, 240)));
  moving.image(320, 240, 0.0, 2.0)(cv::Rect(160, 0, 160, 240)).copyTo(b(cv::Rect(160, 0, 160, 240)));
  const auto errorWith = [&](double sigma_px) {
    LucasKanadeOptions options;
    options.sigma_px = sigma_px;
    options.max_residual = 255.0;
    Pyramid from(1), to(1);
    from.build(a);
    to.build(b);
    LucasKanade tracker(options);
    double sum = 0;
    for (int y = 40; y < 200; y += 4) {
      const Eigen::Vector2f p(163.0f, static_cast<float>(y));
      Eigen::Vector2f q = p + Eigen::Vector2f(0.0f, 2.0f);
      if (tracker.follow(from, to, p, q)) sum += (q - p - Eigen::Vector2f(0.0f, 2.0f)).norm();
    }
    return sum;
  };
  EXPECT_LT(errorWith(2.0), 0.8 * errorWith(0.0));
}

TEST(LucasKanade, RejectsPointsThatCannotBeTracked) {
  const testing::Texture texture(8.0, 9);
  const cv::Mat1b a = texture.image(320, 240);
  Pyramid from(3), to(3), flat(3), other(3);
  from.build(a);
  to.build(a);
  flat.build(cv::Mat1b(240, 320, std::uint8_t{120}));
  other.build(testing::Texture(8.0, 10).image(320, 240));
  LucasKanade tracker(LucasKanadeOptions{});
  Eigen::Vector2f q(160.0f, 120.0f);
  EXPECT_TRUE(tracker.followBothWays(from, to, {160.0f, 120.0f}, q));
  EXPECT_LT((q - Eigen::Vector2f(160.0f, 120.0f)).norm(), 1e-3f);
  EXPECT_FALSE(tracker.followBothWays(flat, flat, {160.0f, 120.0f}, q = {160.0f, 120.0f}));
  EXPECT_FALSE(tracker.followBothWays(from, to, {2.0f, 2.0f}, q = {2.0f, 2.0f}));
  EXPECT_FALSE(tracker.followBothWays(from, to, {NAN, 2.0f}, q = {NAN, 2.0f}));
  int kept = 0;
  for (const auto& p : lattice(a, 60)) kept += tracker.followBothWays(from, other, p, q = p) ? 1 : 0;
  EXPECT_LE(kept, 2);  // unrelated images
}

TEST(LucasKanadeOptions, RejectsRadiusAboveLimit) {
  EXPECT_THROW(LucasKanadeOptions::read(options::Section::parse("radius_px: 11", "t.yaml")), options::Error);
  EXPECT_EQ(LucasKanadeOptions::read(options::Section::parse("levels: 2", "t.yaml")).levels, 2);
}

}  // namespace
}  // namespace omnifleet::flow
