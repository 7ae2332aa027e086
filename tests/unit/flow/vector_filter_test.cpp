#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>

#include "flow/vector_filter.h"

namespace omnifleet::flow {
namespace {

Displacement at(double length, double angle, double sigma = 0.001) {
  return {length * Eigen::Vector2d(std::cos(angle), std::sin(angle)), sigma};
}

TEST(VectorFilter, KeepsCommonMotionSortedByAngle) {
  std::mt19937 random(1);
  std::normal_distribution<double> gauss(0.0, 0.05);
  std::vector<Displacement> vectors;
  for (int i = 0; i < 20; ++i)
    vectors.push_back(at(0.05 * (1 + 0.5 * (i % 3)), 3.1 + gauss(random)));  // around ±π
  vectors.push_back(at(0.05, 0.4));                                          // another direction
  vectors.push_back(at(0.05, -1.5));
  vectors.push_back(at(0.9, 3.1));    // far too long
  vectors.push_back(at(0.008, 3.1));  // far too short
  const auto kept = filterVectors(vectors, {});
  ASSERT_EQ(kept.size(), 20U);
  EXPECT_LT(*std::max_element(kept.begin(), kept.end()), 20U);
  for (std::size_t i = 1; i < kept.size(); ++i) {
    EXPECT_LE(std::atan2(vectors[kept[i - 1]].d_m.y(), vectors[kept[i - 1]].d_m.x()),
              std::atan2(vectors[kept[i]].d_m.y(), vectors[kept[i]].d_m.x()));
  }
}

TEST(VectorFilter, KeepsDisplacementsWithinNoise) {
  std::mt19937 random(2);
  std::normal_distribution<double> gauss(0.0, 0.001);
  std::vector<Displacement> vectors;
  for (int i = 0; i < 30; ++i) vectors.push_back({{gauss(random), gauss(random)}, 0.001});
  EXPECT_GE(filterVectors(vectors, {}).size(), 28U);  // P(|d| > 3σ) = 1.1 % per vector
  vectors.push_back(at(0.2, 1.0));
  const auto kept = filterVectors(vectors, {});
  EXPECT_EQ(std::count(kept.begin(), kept.end(), vectors.size() - 1), 0);
}

TEST(VectorFilter, AcceptsEmptyInput) {
  EXPECT_TRUE(filterVectors({}, {}).empty());
}

TEST(HeightFromVectors, RecoversHeightOfPoints) {
  const double camera_height = 0.5;
  const Eigen::Vector2d u(-0.05, 0.01);
  for (const double h : {0.0, 0.1, 0.2, 0.35}) {
    std::vector<Displacement> vectors;
    for (int i = 0; i < 11; ++i) {
      const double height = h * std::min(1.0, 0.1 * i + 0.3);  // points at all heights, several at the top
      vectors.push_back({u * camera_height / (camera_height - height), 0.0005});
    }
    const Height found = heightFromVectors(vectors, u, camera_height);
    EXPECT_NEAR(found.height_m, h, 1e-9);
    // dh/ds = H/s², σ_s = σ/|u|.
    const double s = camera_height / (camera_height - h);
    EXPECT_NEAR(found.sigma_m, camera_height / (s * s) * 0.0005 / u.norm(), 1e-9);
  }
}

TEST(HeightFromVectors, ReturnsUnknownWithoutMotion) {
  EXPECT_EQ(heightFromVectors({at(0.05, 1.0)}, {0.001, 0.0}, 0.5).sigma_m, 0.0);
  EXPECT_EQ(heightFromVectors({}, {0.05, 0.0}, 0.5).sigma_m, 0.0);
}

}  // namespace
}  // namespace omnifleet::flow
