// One edge per column from the edges in luma and in hue.

#include "distance_vector/edge_fusion.h"

#include <gtest/gtest.h>

#include <cmath>
#include <random>

namespace omnifleet::distance_vector {
namespace {

constexpr float kLuma_px = 0.05f, kHue_px = 0.3f;

/// A boundary whose row falls from left to right, with noise. `shift_px`: of luma, towards the camera.
std::vector<EdgeFusion::Pair> boundary(float shift_px, std::uint32_t seed) {
  std::mt19937 random(seed);
  std::normal_distribution<float> noise(0.0f, 1.0f);
  std::vector<EdgeFusion::Pair> pairs(320);
  for (std::size_t u = 0; u < pairs.size(); ++u) {
    const float row = 150.0f - 0.1f * static_cast<float>(u);
    pairs[u].luma = ColumnEdges::Edge{row + shift_px + kLuma_px * noise(random), kLuma_px};
    pairs[u].hue = ColumnEdges::Edge{row + kHue_px * noise(random), kHue_px};
  }
  return pairs;
}

/// Root mean square of the error of the fused rows, pixels.
float rmsOf(EdgeFusion& fusion, const std::vector<EdgeFusion::Pair>& pairs) {
  const auto& edges = fusion.fuse(pairs);
  float sum = 0.0f;
  for (std::size_t u = 0; u < edges.size(); ++u)
    sum += std::pow(edges[u].row - (150.0f - 0.1f * static_cast<float>(u)), 2.0f);
  return std::sqrt(sum / static_cast<float>(edges.size()));
}

TEST(EdgeFusion, TakesTheShiftOfShadowsOffTheEdgesInLuma) {
  EdgeFusion fusion(12, 2.0f, 0.0f);
  // 25 columns of hue: 0.3 / √25 = 0.06 px, beside the noise of luma.
  EXPECT_LT(rmsOf(fusion, boundary(0.8f, 1)), 0.1f);
  EXPECT_NEAR(fusion.shift(), 0.8f, 0.06f);
}

TEST(EdgeFusion, KeepsTheEdgesInLumaWithoutShadows) {
  EdgeFusion fusion(12, 2.0f, 0.0f);
  EXPECT_LT(rmsOf(fusion, boundary(0.0f, 2)), 0.075f) << "luma alone: 0.05";
  EXPECT_NEAR(fusion.shift(), 0.0f, 0.05f);
}

TEST(EdgeFusion, MovesEdgesWithoutHueByTheShiftOfTheScene) {
  EdgeFusion fusion(12, 2.0f, 0.0f);
  auto pairs = boundary(0.6f, 3);
  // Another boundary, so no neighbour lends its offset.
  for (std::size_t u = 200; u < 240; ++u) {
    pairs[u].luma->row += 20.0f;
    pairs[u].hue.reset();
  }
  const auto& edges = fusion.fuse(pairs);
  for (std::size_t u = 200; u < 240; ++u) {
    EXPECT_NEAR(edges[u].row, 170.0f - 0.1f * static_cast<float>(u), 0.25f) << u;
    EXPECT_GT(edges[u].sigma_px, 0.2f) << "the shift of another object is a guess";
  }
}

TEST(EdgeFusion, TakesTheEdgeInHueBehindTheOneOfAWideShadow) {
  EdgeFusion fusion(12, 2.0f, 0.0f);
  const auto pairs = boundary(6.0f, 4);
  const auto& edges = fusion.fuse(pairs);
  for (std::size_t u = 0; u < edges.size(); ++u) EXPECT_EQ(edges[u].row, pairs[u].hue->row) << u;
}

// A wall as bright as the floor: edges in luma lie on texture.
TEST(EdgeFusion, TakesTheEdgeInHueWhereThatInLumaScatters) {
  EdgeFusion fusion(12, 2.0f, 0.15f);
  auto pairs = boundary(0.0f, 6);
  std::mt19937 random(7);
  std::uniform_real_distribution<float> texture(-2.5f, 2.5f);
  for (auto& pair : pairs) pair.luma->row += texture(random);
  EXPECT_LT(rmsOf(fusion, pairs), 1.2f * kHue_px);
  for (const EdgeFusion::Edge& edge : fusion.fuse(pairs))
    EXPECT_GE(edge.sigma_px, 0.99f * std::hypot(kHue_px, 0.15f));
  for (auto& pair : pairs) pair.weak = true;
  EXPECT_GT(rmsOf(fusion, pairs), 2.0f * kHue_px)
      << "the columns of weak edges are noisy in hue: lines replace them later";
}

TEST(EdgeFusion, UsesTheOnlyEdgeThatThereIs) {
  EdgeFusion fusion(12, 2.0f, 0.0f);
  std::vector<EdgeFusion::Pair> pairs(3);
  pairs[0].luma = ColumnEdges::Edge{100.0f, 0.1f};
  pairs[1].hue = ColumnEdges::Edge{90.0f, 0.4f};
  const auto& edges = fusion.fuse(pairs);
  EXPECT_FLOAT_EQ(edges[0].row, 100.0f);
  EXPECT_FLOAT_EQ(edges[1].row, 90.0f);
  EXPECT_FLOAT_EQ(edges[1].sigma_px, 0.4f);
  EXPECT_TRUE(std::isnan(edges[2].row));
}

}  // namespace
}  // namespace omnifleet::distance_vector
