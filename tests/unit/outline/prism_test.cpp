#include "outline/prism.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "outline/convex_hull.h"
#include "outline/half_planes.h"
#include "outline/vertices.h"
#include "prism_scene.h"

namespace omnifleet {
namespace {

using outline::BodyFit;
using outline::convexIou;
using outline::fitBody;
using outline::fitPrism;
using outline::KnownBody;
using outline::PrismFit;
using outline::PrismOptions;
using outline::PrismView;
using testing::box;
using testing::Prism;

constexpr double kNoBias = 0.0;

std::vector<Prism> scene() {
  const Polygon wedge{{-0.5, 0.9}, {-0.2, 0.85}, {-0.3, 1.2}};
  return {{box({0.4, -0.3}, 0.30, 0.20, 0.4), 0.20},   {circlePolygon({1.2, 0.5}, 0.12, 64), 0.25},
          {box({-0.8, -0.6}, 0.50, 0.12, -0.9), 0.15}, {wedge, 0.30},
          {circlePolygon({0.2, 1.1}, 0.2, 6), 0.10},   {box({-1.4, 0.2}, 0.25, 0.25, 0.1), 0.35}};
}

TEST(Prism, RecoversFootprintFromViewsWithoutNoise) {
  std::mt19937 random(1);
  for (const auto& prism : scene()) {
    const PrismFit fit = fitPrism(testing::views(prism, 3, 4, random, kNoBias), {});
    ASSERT_TRUE(fit.valid);
    // Twelve headings with 96 directions each determine edges to 0.3°. Curves become polygons of about 20
    // vertices.
    EXPECT_GT(convexIou(fit.footprint_m, prism.footprint_m), 0.97);
    EXPECT_LT((centroid(fit.footprint_m) - centroid(prism.footprint_m)).norm(), 0.0006);
    EXPECT_NEAR(fit.height_m, prism.height_m, 0.0015);
    EXPECT_NEAR(fit.coverage, 1.0, 1e-9);
  }
}

TEST(Prism, ReachesSpecifiedAccuracyWithThreeRobots) {
  std::mt19937 random(2);
  double error = 0.0, overlap = 0.0, height = 0.0;
  int count = 0;
  for (int run = 0; run < 5; ++run) {
    for (const auto& prism : scene()) {
      const PrismFit fit = fitPrism(testing::views(prism, 3, 6, random), {});
      ASSERT_TRUE(fit.valid);
      const double one = (centroid(fit.footprint_m) - centroid(prism.footprint_m)).norm();
      const double iou = convexIou(fit.footprint_m, prism.footprint_m);
      EXPECT_LT(one, 0.004);  // m, the worst of 30
      EXPECT_GT(iou, 0.92);
      error += one, overlap += iou, height += std::abs(fit.height_m - prism.height_m);
      ++count;
    }
  }
  RecordProperty("centroid_cm", std::to_string(100 * error / count));
  RecordProperty("iou", std::to_string(overlap / count));
  RecordProperty("height_mm", std::to_string(1000 * height / count));
  std::cout << "mean centroid " << 100 * error / count << " cm, IoU " << overlap / count << ", height "
            << 1000 * height / count << " mm\n";
  EXPECT_LT(error / count, 0.0010);  // docs/results.md: centroids to 0.1 cm
  EXPECT_GT(overlap / count, 0.97);  // docs/results.md: IoU 0.94
  EXPECT_LT(height / count, 0.003);  // docs/results.md: heights to 3 mm
}

TEST(Prism, NeedsOnlyOneViewPerRobot) {
  std::mt19937 random(3);
  double error = 0.0, overlap = 0.0, height = 0.0;
  for (const auto& prism : scene()) {
    const PrismFit fit = fitPrism(testing::views(prism, 3, 1, random), {});
    ASSERT_TRUE(fit.valid);
    error += (centroid(fit.footprint_m) - centroid(prism.footprint_m)).norm() / 6;
    overlap += convexIou(fit.footprint_m, prism.footprint_m) / 6;
    height += std::abs(fit.height_m - prism.height_m) / 6;
  }
  std::cout << "mean centroid " << 100 * error << " cm, IoU " << overlap << ", height " << 1000 * height
            << " mm\n";
  EXPECT_LT(error, 0.003);  // m; noise of one view at 1 m is 0.3 to 1 cm per direction
  EXPECT_GT(overlap, 0.90);
  EXPECT_LT(height, 0.008);
}

TEST(Prism, CompletesOneViewWithKnownHeight) {
  std::mt19937 random(4);
  for (const auto& prism : scene()) {
    const auto view = testing::views(prism, 1, 1, random, kNoBias);
    const PrismFit fit = fitPrism(view, {}, {prism.height_m, 0.001});
    ASSERT_TRUE(fit.valid);
    EXPECT_GT(convexIou(fit.footprint_m, prism.footprint_m), 0.90);  // an edge is known to half of 3.75°
    Eigen::Vector2d steiner;
    ASSERT_TRUE(outline::steinerPoint(view.front(), prism.height_m, steiner));
    // The Steiner points of the polygon and of its sampled support function differ only by the sampling.
    EXPECT_LT((steiner - fit.centre_m).norm(), 0.002);
  }
}

TEST(Prism, EstimatesHeightOfOneViewFromTangents) {
  std::mt19937 random(5);
  for (const auto& prism : scene()) {
    PrismOptions free;
    free.plain_shapes = false;
    const PrismFit fit = fitPrism(testing::views(prism, 1, 1, random, 0.3), free);
    ASSERT_TRUE(fit.valid);
    std::cout << "height " << fit.height_m << " ± " << fit.height_sigma_m << ", true " << prism.height_m
              << "\n";
    EXPECT_GT(fit.height_sigma_m, 0.01);  // the uncertainty is reported
    EXPECT_LT(std::abs(fit.height_m - prism.height_m), 4 * fit.height_sigma_m);
    EXPECT_LT((centroid(fit.footprint_m) - centroid(prism.footprint_m)).norm(),
              0.12);  // m; an initial estimate, not accurate enough for a map
  }
}

bool isPlain(const Prism& prism) {
  return prism.footprint_m.size() == 4 || prism.footprint_m.size() > 8;
}

/// The tangents may lie at the wrap-around of the directions.
TEST(Prism, EstimatesSameHeightAtEveryBearing) {
  PrismOptions options;
  options.plain_shapes = false;
  constexpr int kBearings = 48;  // as many as directions of a view
  double first_m = 0.0;
  for (int k = 0; k < kBearings; ++k) {
    const double bearing = 2.0 * M_PI * k / kBearings;
    Polygon disc;
    for (int i = 0; i < 192; ++i) {
      const double angle = bearing + 2.0 * M_PI * i / 192;
      disc.emplace_back(0.9 * std::cos(bearing) + 0.15 * std::cos(angle),
                        0.9 * std::sin(bearing) + 0.15 * std::sin(angle));
    }
    PrismView view;
    view.camera_height_m = 0.5;
    view.supports = outline::prismSupports(disc, 0.2, view, 0.002);
    const PrismFit fit = fitPrism({view}, options);
    ASSERT_TRUE(fit.valid) << k;
    if (k == 0) first_m = fit.height_m;
    EXPECT_NEAR(fit.height_m, first_m, 1e-6) << "bearing " << k;
  }
}

TEST(Prism, EstimatesHeightOfBoxOrDiscFromOneView) {
  std::mt19937 random(15);
  for (const auto& prism : scene()) {
    if (!isPlain(prism)) continue;
    for (int draw = 0; draw < 5; ++draw) {
      const PrismFit fit = fitPrism(testing::views(prism, 1, 2, random), {});
      ASSERT_TRUE(fit.valid);
      EXPECT_LT(std::abs(fit.height_m - prism.height_m), std::max(4 * fit.height_sigma_m, 0.004));
      EXPECT_LT(fit.height_sigma_m, 0.02);
      // The views are up to 1.5 m away. The far edge of the tall box then lies 5 m from the foot, where a
      // pixel is 17 cm. The reported covariance includes this.
      const double error_m = (centroid(fit.footprint_m) - centroid(prism.footprint_m)).norm();
      EXPECT_LT(error_m, 4 * std::sqrt(fit.covariance.trace()));
      EXPECT_LT(error_m, 0.03);
    }
  }
}

TEST(Prism, KeepsOutlineOfOtherShapes) {
  std::mt19937 random(16);
  for (const auto& prism : scene()) {
    if (isPlain(prism)) continue;
    const auto views = testing::views(prism, 3, 4, random, 0.3);
    PrismOptions free;
    free.plain_shapes = false;
    const PrismFit fit = fitPrism(views, {}), without = fitPrism(views, free);
    ASSERT_TRUE(fit.valid && without.valid);
    EXPECT_EQ(fit.footprint_m, without.footprint_m);
  }
}

TEST(Prism, CompletesHiddenPartOfABox) {
  std::mt19937 random(17);
  const Prism prism = scene().front();
  auto views = testing::views(prism, 2, 2, random, 0.5);
  // In every view the same third of the outline, in map, is hidden behind another object.
  for (auto& view : views) {
    for (std::size_t k = 0; k < view.supports.size(); ++k) {
      const double angle =
          wrapAngle(2.0 * M_PI * static_cast<double>(k) / 96.0 + view.map_from_base.theta_rad - 1.0);
      if (std::abs(angle) < M_PI / 3.0) view.supports.sigma_m[k] = -1.0F;
    }
  }
  PrismOptions free;
  free.plain_shapes = false;
  EXPECT_FALSE(fitPrism(views, free).valid);
  const PrismFit fit = fitPrism(views, {});
  ASSERT_TRUE(fit.valid);
  EXPECT_GT(convexIou(fit.footprint_m, prism.footprint_m), 0.90);
}

/// The contact side alone: the top is outside of the lens's view, or higher than the camera.
PrismView contactSide(PrismView view) {
  for (std::size_t k = 0; k < view.supports.size(); ++k)
    if (view.supports.b_m[k] >= 0.0F) view.supports.sigma_m[k] = -1.0F;
  return view;
}

PrismView viewAlongX(const Prism& prism) {
  PrismView view;
  view.camera_height_m = 0.5;
  view.supports = outline::prismSupports(prism.footprint_m, prism.height_m, view, 0.002);
  return contactSide(view);
}

TEST(Prism, CompletesOneSideWhenTheTopIsNotVisible) {
  const outline::HeightPrior vague{0.25, 0.125};
  for (const Prism& prism :
       {Prism{circlePolygon({0.9, 0.1}, 0.14, 96), 0.4}, Prism{box({0.8, 0.0}, 0.24, 0.18, 0.6), 0.4}}) {
    const PrismFit fit = fitPrism({viewAlongX(prism)}, {}, vague);
    ASSERT_TRUE(fit.valid);
    EXPECT_GT(convexIou(fit.footprint_m, prism.footprint_m), 0.97);  // the supports have no noise
    EXPECT_GT(fit.height_sigma_m, 0.05);                             // no information on the height
  }
  // A single face gives no information on the depth of the object.
  EXPECT_FALSE(fitPrism({viewAlongX({box({0.8, 0.0}, 0.24, 0.18, 0.0), 0.4})}, {}, vague).valid);
}

TEST(Prism, ToleratesCalibrationErrors) {
  // An error of the focal length of 0.3 % scales every distance by about that. A tilt of 0.2° moves a point
  // at distance d by 0.2°·(H² + d²)/H.
  std::mt19937 random(6);
  double error = 0.0, overlap = 0.0;
  for (const auto& prism : scene()) {
    auto views = testing::views(prism, 3, 6, random);
    for (auto& view : views) {
      for (std::size_t k = 0; k < view.supports.size(); ++k) {
        const double phi = 2.0 * M_PI * static_cast<double>(k) / static_cast<double>(view.supports.size());
        const double d = std::abs(view.supports.b_m[k]);
        const double tilt = 0.2 * M_PI / 180.0 * (0.25 + d * d) / 0.5;
        view.supports.b_m[k] = static_cast<float>(view.supports.b_m[k] * 1.004 + tilt * std::cos(phi));
      }
    }
    const PrismFit fit = fitPrism(views, {});
    ASSERT_TRUE(fit.valid);
    error += (centroid(fit.footprint_m) - centroid(prism.footprint_m)).norm() / 6;
    overlap += convexIou(fit.footprint_m, prism.footprint_m) / 6;
  }
  std::cout << "calibration errors: mean centroid " << 100 * error << " cm, IoU " << overlap << "\n";
  EXPECT_LT(error, 0.010);  // m, required: ≤ 1.0 cm
  EXPECT_GT(overlap, 0.85);
}

TEST(Prism, ToleratesUnusableDirectionsAndMergedSilhouette) {
  std::mt19937 random(7);
  for (const auto& prism : scene()) {
    auto views = testing::views(prism, 3, 4, random);
    for (std::size_t v = 0; v < views.size(); ++v) {
      for (std::size_t k = 0; k < 24; ++k) views[v].supports.sigma_m[(7 * v + k) % 96] = 0.0F;
    }
    for (std::size_t k = 30; k < 60; ++k)
      views[0].supports.b_m[k] += 0.15F;  // another object is merged in one view
    views[1].supports.b_m[5] = std::numeric_limits<float>::quiet_NaN();
    const PrismFit fit = fitPrism(views, {});
    ASSERT_TRUE(fit.valid);
    EXPECT_LT((centroid(fit.footprint_m) - centroid(prism.footprint_m)).norm(), 0.006);
    EXPECT_GT(convexIou(fit.footprint_m, prism.footprint_m), 0.85);
    EXPECT_GT(fit.view_rms_m[0], 2 * fit.view_rms_m[5]);
  }
}

TEST(Prism, RejectsOpenOutline) {
  std::mt19937 random(8);
  auto views = testing::views(scene().front(), 1, 1, random);
  for (std::size_t k = 0; k < 50; ++k) views[0].supports.sigma_m[k] = -1.0F;
  EXPECT_FALSE(fitPrism(views, {}, {0.2, 0.01}).valid);
  Eigen::Vector2d centre;
  EXPECT_FALSE(outline::steinerPoint(views[0], 0.2, centre));
  EXPECT_FALSE(fitPrism({}, {}).valid);
  EXPECT_FALSE(fitPrism({PrismView{}}, {}).valid);
}

TEST(Prism, StaysAccurateWhenViewsAreThinned) {
  std::mt19937 random(9);
  const Prism prism = scene().front();
  const auto many = testing::views(prism, 4, 30, random);
  const PrismFit fit = fitPrism(many, {});
  ASSERT_TRUE(fit.valid);
  EXPECT_LT((centroid(fit.footprint_m) - centroid(prism.footprint_m)).norm(), 0.002);
  int used = 0;
  for (const double rms : fit.view_rms_m) used += rms >= 0;
  EXPECT_EQ(used, PrismOptions{}.max_views);
}

TEST(Vertices, FindFourCornersOfABox) {
  const Polygon truth = box({3.0, -2.0}, 0.5, 0.12, 0.7);
  std::mt19937 random(13);
  std::normal_distribution<double> normal(0.0, 0.001);
  std::vector<outline::SupportSample> samples;
  for (int i = 0; i < 600; ++i) {
    const double angle = 0.011 * i;
    double support = -1e9;
    for (const auto& p : truth)
      support = std::max(support, p.x() * std::cos(angle) + p.y() * std::sin(angle));
    samples.push_back({angle, support + normal(random), 1e6});
  }
  const Polygon found = outline::polygonOfSamples(samples, {3.02, -2.01}, 6.0);
  EXPECT_EQ(found.size(), 4U);
  EXPECT_GT(convexIou(found, truth), 0.995);
}

TEST(Vertices, KeepCircleRound) {
  std::vector<outline::SupportSample> samples;
  for (int i = 0; i < 600; ++i) samples.push_back({0.011 * i, 0.15, 1e7});
  const Polygon found = outline::polygonOfSamples(samples, {0, 0}, 6.0);
  EXPECT_GT(found.size(), 12U);
  EXPECT_NEAR(signedArea(found), M_PI * 0.15 * 0.15, 0.01 * M_PI * 0.15 * 0.15);
  EXPECT_TRUE(outline::polygonOfSamples({}, {0, 0}, 6.0).empty());
}

TEST(Body, FitsRoundRobotFromOneView) {
  std::mt19937 random(10);
  const KnownBody body{circlePolygon({0, 0}, 0.15, 48), 0.3, true};
  const Prism robot{circlePolygon({0.7, -0.4}, 0.15, 64), 0.3};
  const auto views = testing::views(robot, 1, 1, random);
  const BodyFit fit = fitBody(views, body, {}, 0.0);
  ASSERT_TRUE(fit.valid);
  EXPECT_LT((fit.map_from_body.translation() - Eigen::Vector2d(0.7, -0.4)).norm(), 0.006);
  EXPECT_LT(fit.rms_m, 0.01);
}

TEST(Body, RejectsBoxOfOtherSize) {
  std::mt19937 random(11);
  const KnownBody body{circlePolygon({0, 0}, 0.15, 48), 0.3, true};
  const Prism crate{box({0.7, -0.4}, 0.6, 0.3, 0.3), 0.2};
  const BodyFit fit = fitBody(testing::views(crate, 2, 2, random), body, {}, 0.0);
  ASSERT_TRUE(fit.valid);
  EXPECT_GT(fit.rms_m, 0.05);  // docs/methods/classifier.md: rms < 5 cm indicates a robot
}

TEST(Body, FitsHeadingOfALongRobot) {
  std::mt19937 random(12);
  const KnownBody body{{{-0.1, -0.12}, {0.25, -0.12}, {0.32, 0.0}, {0.25, 0.12}, {-0.1, 0.12}}, 0.2, false};
  for (const double heading : {0.3, 2.2, -2.9}) {
    const Pose2 place{0.5, 0.2, heading};
    Prism robot{{}, 0.2};
    for (const auto& p : body.outline_m) robot.footprint_m.push_back(place * p);
    const auto views = testing::views(robot, 1, 1, random, 0.5);
    for (const double guess : {heading + 0.15, std::numeric_limits<double>::quiet_NaN()}) {
      const BodyFit fit = fitBody(views, body, {}, guess);
      ASSERT_TRUE(fit.valid);
      EXPECT_LT((fit.map_from_body.translation() - place.translation()).norm(), 0.012);
      EXPECT_LT(std::abs(wrapAngle(fit.map_from_body.theta_rad - heading)), 0.06);
    }
  }
}

TEST(PrismOptions, ReadsValuesAndRejectsInvalidOnes) {
  const auto good =
      PrismOptions::read(options::Section::parse("directions: 48\npose_sigma_m: 0.01\n", "o.yaml"));
  EXPECT_EQ(good.directions, 48);
  EXPECT_DOUBLE_EQ(good.pose_sigma_m, 0.01);
  EXPECT_THROW(PrismOptions::read(options::Section::parse("directions: 2\n", "o.yaml")), options::Error);
  EXPECT_THROW(PrismOptions::read(options::Section::parse("direction: 48\n", "o.yaml")), options::Error);
}

}  // namespace
}  // namespace omnifleet
