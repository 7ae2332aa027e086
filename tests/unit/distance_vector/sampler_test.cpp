#include "distance_vector/bearing_sampler.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace omnifleet::distance_vector {
namespace {

constexpr double kFocal_px = 160.0, kHeight_m = 0.085;

/// Columns of a level camera that see a wall at x = distance_m.
std::vector<ColumnHit> wall(double distance_m, double noise_px, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, noise_px);
  std::vector<ColumnHit> hits(320);
  for (int u = 0; u < 320; ++u) {
    const double bearing = std::atan2(159.5 - u, kFocal_px), range_m = distance_m / std::cos(bearing);
    const double slope = std::cos(bearing) / (kFocal_px * kHeight_m), error_px = noise(random);
    ColumnHit& hit = hits[static_cast<std::size_t>(u)];
    hit.end = End::kEdge;
    hit.row = static_cast<float>(kFocal_px * kHeight_m / distance_m + error_px);
    hit.bearing_rad = static_cast<float>(bearing);
    hit.inverse_m = static_cast<float>(1.0 / range_m + slope * error_px);
    hit.sigma = static_cast<float>(0.1 * slope);
  }
  return hits;
}

/// Finer than the columns.
Options fineBearings() {
  Options options;
  options.bearings = 1440;
  return options;
}

TEST(BearingSampler, InterpolatesAWallExactly) {
  BearingSampler sampler(fineBearings());
  auto hits = wall(0.7, 0.0, 1);
  sampler.sample(hits, {0, 0}, 0.0);
  int n = 0;
  for (std::size_t i = 0; i < 1440; ++i) {
    if (sampler.boundary().sigma[i] == 0.0f) continue;
    ++n;
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / 1440.0;
    EXPECT_NEAR(sampler.boundary().inverse_m[i], std::cos(bearing) / 0.7, 2e-5);
  }
  EXPECT_GE(n, 358);  // 90° in steps of 0.25°
}

// σ predicted too small by three: the second differences show it. It must be right for wide bins too, where
// several columns count.
TEST(BearingSampler, ScalesSigmaToTheNoiseOfTheFrame) {
  for (const int bearings : {1440, 720, 180}) {
    Options options;
    options.bearings = bearings;
    double squares = 0.0;
    int n = 0;
    for (std::uint32_t seed = 1; seed <= 20; ++seed) {
      BearingSampler sampler(options);
      auto hits = wall(0.7, 0.3, seed);
      sampler.sample(hits, {0, 0}, 0.0);
      EXPECT_NEAR(sampler.noiseScale(), 3.0f, 0.9f);
      for (int i = 0; i < bearings; ++i) {
        const auto k = static_cast<std::size_t>(i);
        if (sampler.boundary().sigma[k] == 0.0f) continue;
        const double truth = std::cos(2.0 * M_PI * i / bearings) / 0.7;
        squares += std::pow((static_cast<double>(sampler.boundary().inverse_m[k]) - truth) /
                                static_cast<double>(sampler.boundary().sigma[k]),
                            2);
        ++n;
      }
    }
    EXPECT_NEAR(std::sqrt(squares / n), 1.0, 0.15) << bearings << " bearings";
  }
}

// The column at the silhouette lies between both walls: no bearing may report it.
TEST(BearingSampler, DropsMixedColumnsAtASilhouette) {
  auto hits = wall(0.5, 0.02, 3);
  const auto far = wall(1.0, 0.02, 4);
  for (std::size_t u = 160; u < 320; ++u) hits[u] = far[u];
  hits[160].inverse_m = 0.5f * (hits[159].inverse_m + far[160].inverse_m);
  hits[160].row = 0.5f * (hits[159].row + far[160].row);
  BearingSampler sampler(fineBearings());
  sampler.sample(hits, {0, 0}, 0.0);
  for (std::size_t i = 0; i < 1440; ++i) {
    if (sampler.boundary().sigma[i] == 0.0f) continue;
    const double x = std::cos(2.0 * M_PI * static_cast<double>(i) / 1440.0) /
                     static_cast<double>(sampler.boundary().inverse_m[i]);
    EXPECT_TRUE(std::abs(x - 0.5) < 0.02 || std::abs(x - 1.0) < 0.06) << i << " " << x;
  }
}

TEST(BearingSampler, DropsSingleColumnsThatNothingSupports) {
  auto hits = wall(0.5, 0.05, 3);
  hits[100].inverse_m *= 1.25f;
  hits[100].row *= 1.25f;
  BearingSampler sampler(fineBearings());
  sampler.sample(hits, {0, 0}, 0.0);
  for (std::size_t i = 0; i < 1440; ++i) EXPECT_LT(sampler.boundary().inverse_m[i], 2.05f) << i;
}

TEST(BearingSampler, ReportsFloorEndsAsFreeRays) {
  auto hits = wall(3.0, 0.0, 1);
  for (ColumnHit& hit : hits) hit.end = End::kFloorEnd;
  BearingSampler sampler(fineBearings());
  sampler.sample(hits, {0.04, 0.0}, 0.1);
  EXPECT_EQ(sampler.scan().label[0], RayLabel::kFloorEnd);
  EXPECT_NEAR(sampler.scan().range_m[0], 3.0f, 0.01f);
  EXPECT_EQ(sampler.boundary().sigma[0], 0.0f);
  EXPECT_EQ(sampler.scan().label[720], RayLabel::kInvalid);
  EXPECT_EQ(sampler.boundary().origin_m, Eigen::Vector2d(0.04, 0.0));
}

}  // namespace
}  // namespace omnifleet::distance_vector
