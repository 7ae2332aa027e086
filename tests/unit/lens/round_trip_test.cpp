#include <gtest/gtest.h>

#include "tests/unit/lens/models_for_tests.h"

namespace omnifleet::lens::test {
namespace {

struct Case {
  const char* name;
  CameraModel model;
  double last_deg;  ///< largest angle that this lens sees
};

std::vector<Case> cases() {
  CameraModel strong = model(Projection::kKannalaBrandt);
  strong.distortion = {-0.03, 0.004, -0.001, 0.0002};
  CameraModel affine = simulatedOcam();
  affine.distortion = {
      -368.4018, 0,     0.001229407337764, -1.541328325870701e-06, 3.209246532312631e-09, 1.0002,
      -0.0101,   0.0095};
  CameraModel mirror = simulatedOcam();
  mirror.kind = CameraKind::kCatadioptric;
  CameraModel panorama = model(Projection::kEquidistant);
  panorama.kind = CameraKind::kEquirectangular;
  panorama.focal_px = {1280 / (2 * M_PI), 960 / M_PI};
  return {{"orthographic", model(Projection::kOrthographic), 89.99},
          {"equidistant", model(Projection::kEquidistant), 92.5},
          {"equisolid", model(Projection::kEquisolid), 92.5},
          {"stereographic", model(Projection::kStereographic), 92.5},
          {"kannala_brandt", simulatedKannalaBrandt(), 92.5},
          {"kannala_brandt_strong", strong, 92.5},
          {"ocam", simulatedOcam(), 92.5},
          {"ocam_affine", affine, 92.5},
          {"catadioptric", mirror, 92.5},
          {"pinhole", pinhole({-0.28, 0.09, 0.001, -0.0007, -0.012}), 40.0},
          {"pinhole_rational", pinhole({0.1, -0.05, 0.0003, 0.0002, 0.01, 0.12, -0.02, 0.004}), 45.0},
          {"equirectangular", panorama, 180.0}};
}

class RoundTrip : public ::testing::TestWithParam<Case> {};

TEST_P(RoundTrip, ReturnsSameRay) {
  const auto lens = Lens::make(GetParam().model);
  for (int i = 0; i <= 400; ++i) {
    const double theta = GetParam().last_deg * kDeg * i / 400.0;
    for (int k = 0; k < 24; ++k) {
      const Eigen::Vector3d ray = rayAt(theta, 2.0 * M_PI * k / 24.0 + 0.01);
      const auto pixel = lens->pixelFromRay(3.7 * ray);
      ASSERT_TRUE(pixel) << theta / kDeg << "°";
      const auto back = lens->rayFromPixel(*pixel);
      ASSERT_TRUE(back) << theta / kDeg << "°";
      EXPECT_NEAR(back->norm(), 1.0, 1e-14);
      // The slope of the orthographic lens vanishes at its edge (dr/dθ = cos θ). There one digit of the pixel
      // is worth 1/cos θ.
      const bool flat = GetParam().model.projection == Projection::kOrthographic && theta > 85.0 * kDeg;
      EXPECT_LT((*back - ray).norm(), flat ? 1e-9 : 5e-13) << theta / kDeg << "°";
    }
  }
}

TEST_P(RoundTrip, ReturnsSamePixel) {
  const auto lens = Lens::make(GetParam().model);
  int seen = 0;
  for (double v = 0.0; v < GetParam().model.image_height_px; v += 17.3) {
    for (double u = 0.0; u < GetParam().model.image_width_px; u += 13.7) {
      const auto ray = lens->rayFromPixel({u, v});
      if (!ray) continue;
      ++seen;
      ASSERT_TRUE(ray->allFinite());
      const auto pixel = lens->pixelFromRay(*ray);
      ASSERT_TRUE(pixel) << u << ", " << v;
      // 1e-9 px is a hundred times the spacing of doubles at 1000 px. Near the edge of the orthographic lens
      // that precision is lost, too.
      EXPECT_LT((*pixel - Eigen::Vector2d(u, v)).norm(), 1e-9) << u << ", " << v;
    }
  }
  EXPECT_GT(seen, 500);
}

TEST_P(RoundTrip, ReturnsNothingForNonFiniteInput) {
  const auto lens = Lens::make(GetParam().model);
  const double nan = std::nan(""), infinity = std::numeric_limits<double>::infinity();
  EXPECT_FALSE(lens->rayFromPixel({nan, 100.0}));
  EXPECT_FALSE(lens->rayFromPixel({100.0, infinity}));
  EXPECT_FALSE(lens->pixelFromRay({nan, 0.0, 1.0}));
  EXPECT_FALSE(lens->pixelFromRay({infinity, 0.0, 1.0}));
  EXPECT_FALSE(lens->pixelFromRay({0.0, 0.0, 0.0}));
}

INSTANTIATE_TEST_SUITE_P(Models, RoundTrip, ::testing::ValuesIn(cases()),
                         [](const auto& one) { return std::string(one.param.name); });

TEST(FieldOfView, EndsExactlyAtItsEdge) {
  for (const Projection projection :
       {Projection::kEquidistant, Projection::kEquisolid, Projection::kStereographic}) {
    const auto lens = Lens::make(model(projection));
    EXPECT_TRUE(lens->pixelFromRay(rayAt(92.5 * kDeg, 1.0)));
    EXPECT_FALSE(lens->pixelFromRay(rayAt(92.51 * kDeg, 1.0)));
    EXPECT_FALSE(lens->pixelFromRay({0.0, 0.0, -1.0}));
  }
  const auto ocam = Lens::make(simulatedOcam());
  EXPECT_TRUE(ocam->pixelFromRay(rayAt(92.5 * kDeg, 1.0)));
  EXPECT_FALSE(ocam->pixelFromRay(rayAt(92.51 * kDeg, 1.0)));
}

// Choi eq. 7: L = F²/√(F² − r²) does not exist for r ≥ F.
TEST(FieldOfView, EndsBelowNinetyDegreesForOrthographicLens) {
  const CameraModel m = model(Projection::kOrthographic);
  const auto lens = Lens::make(m);
  EXPECT_FALSE(lens->pixelFromRay(rayAt(M_PI / 2, 0.3)));
  EXPECT_FALSE(lens->pixelFromRay(rayAt(92.0 * kDeg, 0.3)));
  EXPECT_FALSE(lens->rayFromPixel(m.principal_point_px + Eigen::Vector2d(m.focal_px.x() + 1e-9, 0.0)));
  EXPECT_FALSE(lens->rayFromPixel(m.principal_point_px + Eigen::Vector2d(m.focal_px.x() + 5.0, 0.0)));
  EXPECT_TRUE(lens->rayFromPixel(m.principal_point_px + Eigen::Vector2d(m.focal_px.x() - 1e-6, 0.0)));
}

}  // namespace
}  // namespace omnifleet::lens::test
