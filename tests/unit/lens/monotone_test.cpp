#include "lens/monotone.h"

#include <gtest/gtest.h>

#include <cmath>

#include "lens/models.h"
#include "tests/unit/lens/models_for_tests.h"

namespace omnifleet::lens::test {
namespace {

TEST(SolveIncreasing, FindsRootsFromAnyGuess) {
  const auto cubic = [](double x) { return std::make_pair(x * x * x, 3.0 * x * x); };  // zero slope at 0
  for (const double root : {0.0, 1e-6, 0.3, 0.999, 1.0}) {
    for (const double guess : {-5.0, 0.0, 0.5, 1.0, 7.0}) {
      // Where the slope vanishes, the value has full precision, not the root.
      const double x = solveIncreasing(cubic, root * root * root, 0.0, 1.0, guess);
      EXPECT_NEAR(x * x * x, root * root * root, 1e-16);
    }
  }
  const auto step = [](double x) {
    return std::make_pair(std::tanh(50.0 * (x - 0.7)), 50.0 / std::pow(std::cosh(50.0 * (x - 0.7)), 2));
  };
  EXPECT_NEAR(solveIncreasing(step, 0.0, 0.0, 1.0, 0.0), 0.7, 1e-15)
      << "Newton's method alone leaves the bracket";
}

TEST(FirstBreak, ReturnsFirstOfSeveralBreaks) {
  // cos 3x vanishes at π/6, π/2, …
  EXPECT_NEAR(*firstBreak([](double x) { return std::cos(3.0 * x); }, 3.0), M_PI / 6, 1e-12);
  EXPECT_FALSE(firstBreak([](double x) { return std::cos(3.0 * x); }, 0.5));
  EXPECT_NEAR(*firstBreak([](double x) { return std::isnan(x) ? 1.0 : std::nan(""); }, 2.0), 0.0, 1e-3)
      << "NaN counts as not increasing";
}

TEST(WidestField, EndsAtImageCornerOrAtBreak) {
  CameraModel m = model(Projection::kEquidistant);
  m.principal_point_px = {639.5, 479.5};
  m.focal_px = {500.0, 500.0};
  EXPECT_NEAR(widestFovDeg(m), 2.0 * std::hypot(639.5, 479.5) / 500.0 / kDeg, 1e-6);
  m.projection = Projection::kKannalaBrandt;
  m.focal_px = {150.0, 150.0};
  m.distortion = {-0.2, 0.0, 0.0, 0.0};
  EXPECT_NEAR(widestFovDeg(m), 2.0 * std::sqrt(1.0 / 0.6) / kDeg, 0.1)
      << "with k1 alone the break is at √(−1/3k1)";
  m.projection = Projection::kOrthographic;
  m.distortion.clear();
  EXPECT_NEAR(widestFovDeg(m), 180.0, 1e-9);
}

}  // namespace
}  // namespace omnifleet::lens::test
