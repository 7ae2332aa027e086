// The scale of the compass' σ, by simulated turns with known errors.
#include "estimation/compass_quality.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace omnifleet::estimation {
namespace {

constexpr double kSigma_rad = 0.004;

struct Errors {
  double white = 1.0, bias = 0.0;  ///< of the compass, in its σ
  double reference = 0.0;          ///< σ of the reference, in σ of the compass
};

double scaleAfter(int steps, const Errors& errors, std::uint32_t seed = 1) {
  CompassQuality quality;
  std::mt19937 random(seed);
  std::normal_distribution<double> normal;
  double last = 0.0;
  for (int i = 0; i < steps; ++i) {
    // A reference measures headings: its error of a turn is that of both.
    const double heading = errors.reference / std::sqrt(2.0) * normal(random);
    const double error = errors.white * normal(random) + errors.bias - (heading - last);
    last = heading;
    quality.add(error * kSigma_rad, kSigma_rad, {errors.reference * kSigma_rad, false});
  }
  return quality.scale();
}

TEST(CompassQuality, KeepsAConsistentSigma) {
  double sum = 0.0;
  for (std::uint32_t seed = 0; seed < 50; ++seed) sum += scaleAfter(200, {1.0, 0.0, 1.0}, seed) / 50;
  EXPECT_LT(sum, 1.25);
  EXPECT_EQ(CompassQuality().scale(), 1.0);
}

TEST(CompassQuality, ScalesASigmaThatIsTooSmall) {
  double sum = 0.0;
  for (std::uint32_t seed = 0; seed < 50; ++seed) sum += scaleAfter(200, {5.0, 0.0, 1.0}, seed) / 50;
  EXPECT_NEAR(sum, 5.0, 1.0);
}

// The sum of n turns errs by n times the bias: n independent errors of √n times the bias.
TEST(CompassQuality, CountsABiasByItsSumOverTheMemory) {
  const CompassQualityOptions options;
  const double n = options.memory_steps,
               expected = std::sqrt((n * n + options.prior_steps) / (n + options.prior_steps));
  EXPECT_NEAR(scaleAfter(500, {0.0, 1.0, 0.0}), expected, 0.05);
}

// Wheels whose turns err by one of their σ each, all in one direction: the compass may be right.
TEST(CompassQuality, DoesNotCountTheBiasOfWheelsAsOneOfTheCompass) {
  CompassQuality by_wheels, by_scans;
  for (int i = 0; i < 100; ++i) {
    by_wheels.add(3.0 * kSigma_rad, kSigma_rad, {3.0 * kSigma_rad, true});
    by_scans.add(3.0 * kSigma_rad, kSigma_rad, {3.0 * kSigma_rad, false});
  }
  EXPECT_EQ(by_wheels.scale(), 1.0);
  EXPECT_GT(by_scans.scale(), 10.0);
}

TEST(CompassQuality, RegainsASmallerSigmaWithinTheMemory) {
  CompassQuality quality;
  for (int i = 0; i < 30; ++i) quality.add((i % 2 == 0 ? 8.0 : -8.0) * kSigma_rad, kSigma_rad, {});
  EXPECT_GT(quality.scale(), 5.0);
  for (int i = 0; i < 150; ++i) quality.add((i % 2 == 0 ? 0.5 : -0.5) * kSigma_rad, kSigma_rad, {});
  EXPECT_LT(quality.scale(), 1.3);
}

TEST(CompassQuality, IgnoresWrongReferencesAndTurnsWithoutSigma) {
  CompassQuality quality;
  for (int i = 0; i < 20; ++i) {
    quality.add(1.0, kSigma_rad, {});
    quality.add(0.1, 0.0, {});
    quality.add(std::nan(""), kSigma_rad, {});
  }
  EXPECT_EQ(quality.scale(), 1.0);
}

}  // namespace
}  // namespace omnifleet::estimation
