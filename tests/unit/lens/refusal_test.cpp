#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdlib>

#include "tests/unit/lens/models_for_tests.h"

namespace omnifleet::lens::test {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

std::string refusal(const CameraModel& m) {
  try {
    Lens::make(m);
  } catch (const options::Error& error) {
    return error.what();
  }
  return "";
}

/// The number after "beyond ".
double namedAngle(const std::string& message) {
  const std::size_t at = message.find("beyond ");
  return at == std::string::npos ? -1.0 : std::atof(message.c_str() + at + 7);
}

// ρ' = 1 + 3 k1 θ² vanishes at θ = √(−1/(3 k1)).
TEST(Refusal, KannalaBrandtNamesTheAngle) {
  CameraModel m = model(Projection::kKannalaBrandt);
  m.distortion = {-0.2, 0.0, 0.0, 0.0};
  EXPECT_NEAR(namedAngle(refusal(m)), std::sqrt(1.0 / 0.6) / kDeg, 0.01);
  m.fov_deg = 2.0 * 73.0;  // 73.97° is where it breaks
  EXPECT_EQ(refusal(m), "");
}

// z(ρ) = 300 + 0.004 ρ² turns back where z − ρ z' = 300 − 0.004 ρ² = 0: tan θ = ρ/z at ρ = √(300/0.004).
TEST(Refusal, OcamNamesTheAngle) {
  CameraModel m = simulatedOcam();
  m.distortion = {-300.0, 0.0, -0.004, 1.0, 0.0, 0.0};
  const double rho = std::sqrt(300.0 / 0.004);
  EXPECT_NEAR(namedAngle(refusal(m)), std::atan2(rho, 600.0) / kDeg, 0.01);
}

TEST(Refusal, OcamSignAndAffine) {
  CameraModel m = simulatedOcam();
  for (std::size_t i = 0; i < 5; ++i) m.distortion[i] = -m.distortion[i];
  EXPECT_THAT(refusal(m), HasSubstr("ss0 must be negative"));
  m = simulatedOcam();
  m.distortion[5] = 0.0;
  m.distortion[6] = m.distortion[7] = 1.0;
  EXPECT_THAT(refusal(m), HasSubstr("c − d·e"));
}

// g' = 1 + 3 k1 r² vanishes at r = √(−1/(3 k1)); the image's edge lies beyond.
TEST(Refusal, PinholeThatTurnsBackInsideTheImage) {
  const std::string message = refusal(pinhole({-1.5, 0.0, 0.0, 0.0, 0.0}));
  EXPECT_NEAR(namedAngle(message), std::atan(std::sqrt(1.0 / 4.5)) / kDeg, 0.02);
}

TEST(Refusal, PinholeRefusesPointsBeyondItsMonotonicRange) {
  CameraModel m = pinhole({-0.3, 0.0, 0.0, 0.0, 0.0});
  m.focal_px = {1000.0, 1000.0};
  const auto lens = Lens::make(m);
  const double end = std::sqrt(1.0 / 0.9);  // r up to which r·(1 − 0.3 r²) increases
  EXPECT_TRUE(lens->pixelFromRay({0.99 * end, 0.0, 1.0}));
  EXPECT_FALSE(lens->pixelFromRay({1.01 * end, 0.0, 1.0}));
  EXPECT_FALSE(lens->pixelFromRay({0.1, 0.0, -1.0})) << "behind the camera";
  const double edge_px = 1000.0 * end * (1.0 - 0.3 * end * end);
  EXPECT_TRUE(lens->rayFromPixel(m.principal_point_px + Eigen::Vector2d(edge_px - 0.1, 0.0)));
  EXPECT_FALSE(lens->rayFromPixel(m.principal_point_px + Eigen::Vector2d(edge_px + 0.1, 0.0)));
}

TEST(Refusal, NumbersOfTheWrongKind) {
  CameraModel m = model(Projection::kEquidistant);
  m.focal_px = {0.0, 100.0};
  EXPECT_THAT(refusal(m), StartsWith("focal_px:"));
  m = model(Projection::kEquidistant);
  m.distortion = {0.1};
  EXPECT_THAT(refusal(m), StartsWith("distortion:"));
  m = model(Projection::kKannalaBrandt);
  m.distortion = {0.1, 0.2, 0.3};
  EXPECT_THAT(refusal(m), HasSubstr("k1, k2, k3, k4"));
  m = model(Projection::kEquidistant);
  m.image_width_px = 0;
  EXPECT_THAT(refusal(m), StartsWith("image_width"));
  m = simulatedOcam();
  m.distortion.resize(4);
  EXPECT_THAT(refusal(m), HasSubstr("ss0"));
}

}  // namespace
}  // namespace omnifleet::lens::test
