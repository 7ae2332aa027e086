#include <gtest/gtest.h>

#include <cmath>

#include "geometry/polygon.h"
#include "outline/half_planes.h"
#include "outline/prism.h"

namespace omnifleet::outline {
namespace {

constexpr double kHeight_m = 0.2, kCamera_m = 0.5;

/// Views of a disc's top face, or of the whole disc, from a camera that passes on a straight line. In closed
/// form from the disc's support R + n·(p − c): the top face is seen at s = H/(H − h) times that. The support
/// of the whole disc is the larger of both values.
std::vector<PrismView> passing(bool whole, bool as_tops) {
  constexpr double kRadius_m = 0.11;
  const Eigen::Vector2d place(1.0, 0.1);
  std::vector<PrismView> views;
  for (int i = 0; i < 16; ++i) {
    PrismView view;
    view.map_from_base = {-0.2 + 0.1 * i, -0.5, 0.2};
    view.camera_height_m = kCamera_m;
    view.top_face_only = as_tops;
    const Eigen::Vector2d to = view.map_from_base.inverse() * place;
    for (int k = 0; k < SupportFunction::kDirections; ++k) {
      const double angle = 2.0 * M_PI * k / SupportFunction::kDirections;
      const double g = kRadius_m + to.dot(Eigen::Vector2d(std::cos(angle), std::sin(angle)));
      const double of_top = g * kCamera_m / (kCamera_m - kHeight_m);
      view.supports.b_m.push_back(static_cast<float>(whole ? std::max(g, of_top) : of_top));
      view.supports.sigma_m.push_back(0.002F);
    }
    views.push_back(view);
  }
  return views;
}

TEST(TopFaces, DetermineHeightPlaceAndOutline) {
  const PrismFit fit = fitPrism(passing(false, true), {});
  ASSERT_TRUE(fit.valid);
  EXPECT_NEAR(fit.height_m, kHeight_m, 0.002);
  EXPECT_GT(fit.height_sigma_m, 0.0);
  EXPECT_LT(fit.height_sigma_m, 0.02);
  EXPECT_LT((fit.centre_m - Eigen::Vector2d(1.0, 0.1)).norm(), 0.003);
  EXPECT_GT(convexIou(fit.footprint_m, circlePolygon({1.0, 0.1}, 0.11, 96)), 0.98);
  EXPECT_LT(fit.spread, 0.2);
  const PrismFit whole = fitPrism(passing(false, false), {});
  EXPECT_GT(whole.spread, 5.0 * fit.spread);
}

TEST(TopFaces, DoNotFitWhenTheSidesAreVisible) {
  const PrismFit whole = fitPrism(passing(true, false), {}), top = fitPrism(passing(true, true), {});
  ASSERT_TRUE(whole.valid);
  EXPECT_GT(top.spread, 4.0 * whole.spread);
}

TEST(TopFaces, ArePredictedAsObserved) {
  const auto views = passing(false, true);
  const Polygon disc = circlePolygon({1.0, 0.1}, 0.11, 720);
  const SupportFunction expected = prismSupports(disc, kHeight_m, views[3], 0.002);
  for (std::size_t k = 0; k < expected.size(); ++k)
    EXPECT_NEAR(expected.b_m[k], views[3].supports.b_m[k], 1e-4) << k;
}

TEST(TopFaces, AreNotUsedForLasers) {
  auto views = passing(false, true);
  for (PrismView& view : views) view.camera_height_m = 0.0;
  const PrismFit fit = fitPrism(views, {});
  EXPECT_EQ(fit.height_sigma_m, 0.0);
}

}  // namespace
}  // namespace omnifleet::outline
