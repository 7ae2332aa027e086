#include "lens/spread.h"

#include <gtest/gtest.h>

#include "models_for_tests.h"

namespace omnifleet::lens {
namespace {

Spread spreadOf(CameraModel model) {
  model.position_m = {0.0, 0.0, 0.5};
  return Spread::of(Camera(model));
}

TEST(Spread, ReturnsKappaOfClosedFormProjections) {
  EXPECT_NEAR(spreadOf(test::model(Projection::kOrthographic)).kappa(), 1.0, 1e-4);
  EXPECT_NEAR(spreadOf(test::model(Projection::kEquisolid)).kappa(), 0.25, 1e-4);
  EXPECT_NEAR(spreadOf(test::model(Projection::kEquidistant)).kappa(), 0.0, 1e-4);
  EXPECT_LT(spreadOf(test::model(Projection::kStereographic)).kappa(), -0.4);
}

TEST(Spread, MatchesRadiusRatioOfLens) {
  for (const CameraModel& model :
       {test::model(Projection::kOrthographic), test::model(Projection::kEquisolid),
        test::model(Projection::kStereographic), test::simulatedOcam(), test::simulatedKannalaBrandt()}) {
    const Spread spread = spreadOf(model);
    const auto lens = Lens::make(model);
    const auto radiusAt = [&](double theta) {
      return (*lens->pixelFromRay(test::rayAt(theta, 0.7)) - *lens->pixelFromRay({0.0, 0.0, 1.0})).norm();
    };
    for (double theta = 10 * test::kDeg; theta < 76 * test::kDeg; theta += 5 * test::kDeg) {
      const double ratio = radiusAt(theta) / ((radiusAt(theta + 1e-4) - radiusAt(theta - 1e-4)) / 2e-4);
      EXPECT_NEAR(spread.radius(theta) / spread.slope(theta), ratio, 0.03 * ratio)
          << static_cast<int>(model.projection) << " at " << theta / test::kDeg;
    }
  }
}

}  // namespace
}  // namespace omnifleet::lens
