// Geometry and checks of marker sets, and the predicted image of a marker against sampled points.

#include "markers/layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>

#include "markers/template_model.h"
#include "painted_robots.h"

namespace omnifleet::markers {
namespace {

const ColourOptions kColourTest{0.16, 40, 0.25};

std::string layoutError(const dataset::MarkerSet& set) {
  try {
    const Layout layout(set, kColourTest);
  } catch (const options::Error& error) {
    return error.what();
  }
  return "";
}

TEST(MarkerLayout, SharesOneClassBetweenEqualColours) {
  const Layout layout(coverSet(), kColourTest);
  EXPECT_EQ(layout.colours().size(), 4U);  // four colours in twelve roles
  ASSERT_EQ(layout.patterns().size(), 4U);
  EXPECT_EQ(layout.patterns()[0].colours[0], layout.patterns()[1].colours[0]);
  EXPECT_EQ(layout.patterns()[0].colours[2], layout.patterns()[3].colours[0]);  // r1's head, r4's cover
  EXPECT_NEAR(layout.area(), 0.12 * 0.10, 1e-4);
  EXPECT_TRUE(layout.isConnected());
  EXPECT_FALSE(Layout(patchSet(), kColourTest).isConnected());
}

TEST(MarkerLayout, NamesRobotAndKeyOfUnusableColour) {
  auto set = coverSet();
  set.robots["r2"].tail = {120, 122, 119};
  EXPECT_THAT(layoutError(set), testing::HasSubstr("robots.r2.tail_rgb"));
  EXPECT_THAT(layoutError(set), testing::HasSubstr("min_saturation"));
  set = coverSet();
  set.robots["r3"].head = {30, 5, 5};
  EXPECT_THAT(layoutError(set), testing::HasSubstr("robots.r3.head_rgb"));
  EXPECT_THAT(layoutError(set), testing::HasSubstr("min_brightness"));
  auto patches = patchSet();
  patches.team = {200, 200, 200};
  EXPECT_THAT(layoutError(patches), testing::HasSubstr("team_rgb"));
}

TEST(MarkerLayout, RejectsRobotsThatLookAlike) {
  auto set = coverSet();
  set.robots["r5"] = set.robots["r2"];
  EXPECT_THAT(layoutError(set), testing::AllOf(testing::HasSubstr("r2"), testing::HasSubstr("r5")));
  // Head and tail of equal sizes and mirrored offsets: r1 turned by 180° looks like r2.
  set = coverSet();
  set.head_size_m = set.tail_size_m;
  set.head_offset_m = -set.tail_offset_m;
  EXPECT_THAT(layoutError(set), testing::HasSubstr("turned by 180"));
  set.robots.erase("r2");
  EXPECT_EQ(layoutError(set), "");
  set.robots["r1"].tail = set.robots["r1"].head;
  EXPECT_THAT(layoutError(set), testing::HasSubstr("no heading"));
  EXPECT_EQ(layoutError(coverSet()), "");
}

/// Edges coincide: the head ends at the front edge of the cover, the tail overlaps the head.
const std::vector<Rectangle> kPainted{
    {{0.0, 0.0}, {0.06, 0.05}}, {{0.0, 0.01}, {0.03, 0.02}}, {{0.04, 0.0}, {0.02, 0.05}}};

TEST(TemplateModel, MatchesSampledImageOfPaintedRectangles) {
  TemplateModel model(kPainted);
  std::mt19937 random(4);
  std::uniform_real_distribution<float> place(-0.08F, 0.08F);
  constexpr Eigen::Index kPoints = 40;
  Eigen::ArrayXf u(kPoints), v(kPoints);
  for (Eigen::Index i = 0; i < kPoints; ++i) u[i] = place(random), v[i] = place(random);
  Coverage coverage;
  const Eigen::Vector2d sigma(0.006, 0.004);
  model.evaluate(u, v, kPoints, sigma, coverage);
  // The blur is a convolution of three boxes: three uniform numbers per axis sample it.
  std::uniform_real_distribution<double> box(-0.5, 0.5);
  constexpr int kSamples = 20000;
  for (Eigen::Index i = 0; i < kPoints; ++i) {
    std::array<double, 3> share{};
    for (int s = 0; s < kSamples; ++s) {
      const double dx = 2.0 * sigma.x() * (box(random) + box(random) + box(random)),
                   dy = 2.0 * sigma.y() * (box(random) + box(random) + box(random));
      for (std::size_t r = 3; r-- > 0;) {
        if (!kPainted[r].contains({u[i] + dx, v[i] + dy})) continue;
        share[r] += 1.0 / kSamples;
        break;
      }
    }
    for (Eigen::Index r = 0; r < 3; ++r)  // 5 σ of the sampled share
      EXPECT_NEAR(coverage.value(i, r), share[static_cast<std::size_t>(r)], 0.018) << i << " region " << r;
  }
  EXPECT_NEAR(model.area(2), 0.04 * 0.10, 1e-12);
  EXPECT_NEAR(model.area(1), 0.05 * 0.04, 1e-12);  // 1 cm of it lies below the head
  EXPECT_NEAR(model.area(0), 0.12 * 0.10 - 0.04 * 0.10 - 0.05 * 0.04, 1e-12);
}

TEST(TemplateModel, HasDerivativesOfItsValues) {
  TemplateModel model(kPainted);
  std::mt19937 random(5);
  std::uniform_real_distribution<float> place(-0.08F, 0.08F);
  constexpr Eigen::Index kPoints = 200;
  constexpr float kStep = 2e-4F;
  Eigen::ArrayXf u(kPoints), v(kPoints);
  for (Eigen::Index i = 0; i < kPoints; ++i) u[i] = place(random), v[i] = place(random);
  const Eigen::Vector2d sigma(0.006, 0.004);
  Coverage at, plus, minus;
  model.evaluate(u, v, kPoints, sigma, at);
  const auto check = [&](const Eigen::ArrayXXf& derivative, float step, float tolerance) {
    for (Eigen::Index i = 0; i < kPoints; ++i)
      for (Eigen::Index r = 0; r < 3; ++r)
        EXPECT_NEAR(derivative(i, r), (plus.value(i, r) - minus.value(i, r)) / (2 * step), tolerance);
  };
  model.evaluate(u + kStep, v, kPoints, sigma, plus);
  model.evaluate(u - kStep, v, kPoints, sigma, minus);
  check(at.du, kStep, 0.5F);  // of up to 62 per metre; the second derivative jumps
  model.evaluate(u, v + kStep, kPoints, sigma, plus);
  model.evaluate(u, v - kStep, kPoints, sigma, minus);
  check(at.dv, kStep, 1.0F);
  model.evaluate(u, v, kPoints, sigma * std::exp(0.01), plus);
  model.evaluate(u, v, kPoints, sigma * std::exp(-0.01), minus);
  check(at.d_log_sigma, 0.01F, 0.003F);
}

}  // namespace
}  // namespace omnifleet::markers
