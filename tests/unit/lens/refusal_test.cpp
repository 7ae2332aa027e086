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
TEST(Refusal, NamesBreakAngleOfKannalaBrandt) {
  CameraModel m = model(Projection::kKannalaBrandt);
  m.distortion = {-0.2, 0.0, 0.0, 0.0};
  EXPECT_NEAR(namedAngle(refusal(m)), std::sqrt(1.0 / 0.6) / kDeg, 0.01);
  m.fov_deg = 2.0 * 73.0;  // the break is at 73.97°
  EXPECT_EQ(refusal(m), "");
}

// z(ρ) = 300 + 0.004 ρ² stops increasing in θ where z − ρ z' = 300 − 0.004 ρ² = 0: tan θ = ρ/z at ρ =
// √(300/0.004).
TEST(Refusal, NamesBreakAngleOfOcam) {
  CameraModel m = simulatedOcam();
  m.distortion = {-300.0, 0.0, -0.004, 1.0, 0.0, 0.0};
  const double rho = std::sqrt(300.0 / 0.004);
  EXPECT_NEAR(namedAngle(refusal(m)), std::atan2(rho, 600.0) / kDeg, 0.01);
}

TEST(Refusal, RejectsOcamWithWrongSignOrAffinePart) {
  CameraModel m = simulatedOcam();
  for (std::size_t i = 0; i < 5; ++i) m.distortion[i] = -m.distortion[i];
  EXPECT_THAT(refusal(m), HasSubstr("ss0 must be negative"));
  m = simulatedOcam();
  m.distortion[5] = 0.0;
  m.distortion[6] = m.distortion[7] = 1.0;
  EXPECT_THAT(refusal(m), HasSubstr("c − d·e"));
}

// g' = 1 + 3 k1 r² vanishes at r = √(−1/(3 k1)); the edge of the image lies beyond.
TEST(Refusal, RejectsPinholeThatBreaksInsideImage) {
  const std::string message = refusal(pinhole({-1.5, 0.0, 0.0, 0.0, 0.0}));
  EXPECT_NEAR(namedAngle(message), std::atan(std::sqrt(1.0 / 4.5)) / kDeg, 0.02);
}

TEST(Refusal, ReturnsNothingBeyondMonotonicRangeOfPinhole) {
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

// The break may lie beyond 90°: ρ' = 1 − 3 a θ² vanishes at 100°. A field of view of 92.5° from the axis does
// not reach it.
TEST(Refusal, AcceptsKannalaBrandtThatBreaksOutsideFieldOfView) {
  const double break_rad = 100.0 * kDeg;
  CameraModel m = model(Projection::kKannalaBrandt, 2.0 * 99.9);
  m.distortion = {-1.0 / (3.0 * break_rad * break_rad), 0.0, 0.0, 0.0};
  EXPECT_EQ(refusal(m), "");
  m.fov_deg = 185.0;
  EXPECT_EQ(refusal(m), "");
  const auto lens = Lens::make(m);
  const auto pixel = lens->pixelFromRay(rayAt(92.5 * kDeg, 0.4));
  ASSERT_TRUE(pixel);
  EXPECT_LT((*lens->rayFromPixel(*pixel) - rayAt(92.5 * kDeg, 0.4)).norm(), 1e-12);
  m.fov_deg = 201.0;
  EXPECT_NEAR(namedAngle(refusal(m)), 100.0, 0.01);
}

// z(ρ) = 300 − b ρ³: θ' ∝ z − ρ z' = 300 + 2 b ρ³ > 0 for every ρ, so θ tends to 180°. With + c ρ⁴, θ stops
// increasing where 300 + 2 b ρ³ − 3 c ρ⁴ = 0, here beyond 90°.
TEST(Refusal, AcceptsOcamThatBreaksOutsideFieldOfView) {
  CameraModel m = simulatedOcam(185.0);
  const double b = 2e-5, c = 2e-8;
  m.distortion = {-300.0, 0.0, 0.0, b, -c, 1.0, 0.0, 0.0};
  double rho = 0.0;
  while (300.0 + 2.0 * b * rho * rho * rho - 3.0 * c * std::pow(rho, 4) > 0.0) rho += 1e-3;
  const double break_deg = std::atan2(rho, 300.0 - b * rho * rho * rho + c * std::pow(rho, 4)) / kDeg;
  ASSERT_GT(break_deg, 92.5);
  m.fov_deg = 2.0 * (break_deg - 0.1);
  EXPECT_EQ(refusal(m), "");
  m.fov_deg = 2.0 * (break_deg + 0.5);
  EXPECT_NEAR(namedAngle(refusal(m)), break_deg, 0.05);
}

TEST(Refusal, RejectsInvalidNumbers) {
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
