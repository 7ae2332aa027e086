// The method of Ahmed et al. 2013 as printed: eq. 1–5.

#include <gtest/gtest.h>

#include <cmath>
#include <fstream>

#include "distance_vector/scale_fit.h"
#include "tests/test_data.h"
#include "tests/unit/distance_vector/measure.h"

namespace omnifleet::test {
namespace {

using distance_vector::DistanceVector;
using distance_vector::ScaleFit;
using distance_vector::ScalePair;

constexpr double kMetresPerPixel = 0.004;  // of the ceiling camera

class LiteralMethod : public testing::Test {
 protected:
  static World wallAt(double x_m) {
    World world;
    world.texture = 0.02;
    world.blocks.push_back({{x_m + 0.05, 0.0}, {0.05, 3.0}, 0.0, 0.4, {60, 60, 170}});
    return world;
  }
  /// Table 1 for this camera: an object straight ahead, seen by the robot and by the ceiling.
  distance_vector::Options calibrated(const TempFolder& folder) const {
    std::vector<ScalePair> pairs;
    for (double x = 0.2; x <= 1.0; x += 0.08) {
      const auto pixel = camera_.pixelFromPoint({x, 0.0, 0.0});
      pairs.push_back({239.0 - pixel->y(), x / kMetresPerPixel});
    }
    distance_vector::Options options;
    options.method = distance_vector::Method::kLiteral;
    options.literal.metres_per_ceiling_px = kMetresPerPixel;
    options.literal.scale_file = folder / "scale.yaml";
    std::ofstream(options.literal.scale_file) << ScaleFit(pairs, 4).toYaml();
    return options;
  }

  lens::Camera camera_{forwardCamera()};
  RayCaster caster_{camera_};
  TempFolder folder_;
};

TEST_F(LiteralMethod, MeasuresStraightAheadFromTheRobotsPosition) {
  DistanceVector vector(camera_, calibrated(folder_));
  for (const double x : {0.3, 0.5, 0.8}) {
    vector.process(caster_.render(wallAt(x), {}));
    EXPECT_EQ(vector.boundary().origin_m, Eigen::Vector2d(0, 0));
    ASSERT_EQ(vector.scan().label[0], RayLabel::kObstacle);
    // One pixel of the image is 0.7, 1.7 and 4.4 cm there; the boundary is good to two pixels.
    EXPECT_NEAR(vector.scan().range_m[0], x, 0.012 + 2.0 * x * x / 13.6);
    EXPECT_GT(vector.scan().sigma_m[0], 0.0f);
  }
}

// A column is not a bearing, and d_r is not the distance along it: a straight wall becomes bent. The
// projected method keeps it straight.
TEST_F(LiteralMethod, BendsAWallThatTheProjectedMethodKeepsStraight) {
  const World world = wallAt(0.5);
  const cv::Mat image = caster_.render(world, {});
  DistanceVector literal(camera_, calibrated(folder_)), projected(camera_, {});
  literal.process(image);
  projected.process(image);
  const auto worst_m = [](const DistanceVector& vector) {
    double worst = 0.0;
    const Scan& scan = vector.scan();
    for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
      if (scan.label[i] != RayLabel::kObstacle) continue;
      const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(scan.range_m.size());
      worst = std::max(worst, std::abs(scan.origin_m.x() +
                                       static_cast<double>(scan.range_m[i]) * std::cos(bearing) - 0.5));
    }
    return worst;
  };
  EXPECT_LT(worst_m(projected), 0.02);
  EXPECT_GT(worst_m(literal), 0.05);
}

TEST_F(LiteralMethod, ReportsNothingOutsideOfTheFittedInterval) {
  DistanceVector vector(camera_, calibrated(folder_));
  vector.process(caster_.render(wallAt(1.4), {}));
  EXPECT_EQ(vector.scan().label[0], RayLabel::kInvalid);
  EXPECT_EQ(vector.boundary().sigma[0], 0.0f);
}

TEST_F(LiteralMethod, UsesThePapersPolynomialWithoutAScaleFile) {
  auto options = calibrated(folder_);
  options.literal.scale_file.clear();
  DistanceVector vector(camera_, options);
  vector.process(caster_.render(wallAt(0.4), {}));
  ASSERT_EQ(vector.scan().label[0], RayLabel::kObstacle);
  const double robot_px = 239.0 - static_cast<double>(vector.edgeRows()[160]);
  const auto alpha = distance_vector::paperAlpha(robot_px);
  ASSERT_TRUE(alpha);
  EXPECT_NEAR(vector.scan().range_m[0], kMetresPerPixel * robot_px * *alpha, 0.02);
}

TEST_F(LiteralMethod, OptionsNeedTheScaleOfTheCeilingCamera) {
  using distance_vector::Options;
  EXPECT_THROW(Options::read(options::Section::parse("method: literal\n", "o.yaml")), options::Error);
  EXPECT_THROW(Options::read(options::Section::parse("method: exact\n", "o.yaml")), options::Error);
  EXPECT_THROW(Options::read(options::Section::parse("walk: {min_chrome: 3}\n", "o.yaml")), options::Error);
  const Options options = Options::read(
      options::Section::parse("method: literal\nbearings: 720\nliteral: {metres_per_ceiling_px: 0.004, "
                              "field_of_view_deg: 80}\nwalk: {horizon_px: 3}\n",
                              "o.yaml"));
  EXPECT_EQ(options.method, distance_vector::Method::kLiteral);
  EXPECT_EQ(options.bearings, 720);
  EXPECT_EQ(options.walk.horizon_px, 3.0);
}

TEST_F(LiteralMethod, RejectsAMissingScaleFile) {
  auto options = calibrated(folder_);
  options.literal.scale_file = folder_ / "missing.yaml";
  EXPECT_THROW(DistanceVector(camera_, options), options::Error);
}

}  // namespace
}  // namespace omnifleet::test
