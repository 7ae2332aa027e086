// Lines through edges of low contrast.

#include "distance_vector/weak_edges.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>
#include <random>

namespace omnifleet::distance_vector {
namespace {

constexpr float kShared_px = 0.4f;

struct Boundary {
  std::vector<ColumnEnd> ends{320};
  std::vector<EdgeFusion::Edge> edges{320};
};

/// Weak edges with a noise of half a pixel around a true row; every seventh lies somewhere else.
Boundary weakBoundary(const std::function<float(float)>& row) {
  Boundary boundary;
  std::mt19937 random(11);
  std::normal_distribution<float> noise(0.0f, 0.5f);
  std::uniform_real_distribution<float> elsewhere(-6.0f, 6.0f);
  for (std::size_t u = 0; u < boundary.edges.size(); ++u) {
    boundary.ends[u].end = End::kEdge;
    boundary.ends[u].weak = true;
    boundary.edges[u] = {row(static_cast<float>(u)) + (u % 7 == 0 ? elsewhere(random) : noise(random)), 0.5f};
  }
  return boundary;
}

float rmsOf(const std::vector<EdgeFusion::Edge>& edges, const std::function<float(float)>& row) {
  float sum = 0.0f;
  for (std::size_t u = 0; u < edges.size(); ++u)
    sum += std::pow(edges[u].row - row(static_cast<float>(u)), 2.0f);
  return std::sqrt(sum / static_cast<float>(edges.size()));
}

TEST(WeakEdges, AreReplacedByALineThroughTheirNeighbours) {
  const auto row = [](float u) { return 150.0f - 0.2f * u; };
  const Boundary boundary = weakBoundary(row);
  WeakEdges weak(25, 2.0f, 5.0f, kShared_px);
  // 25 columns of 0.5 px at the middle of the line 0.1 px, at its end 0.2 px.
  EXPECT_LT(rmsOf(weak.smooth(boundary.ends, boundary.edges), row), 0.25f);
  EXPECT_GT(rmsOf(boundary.edges, row), 1.0f);
}

TEST(WeakEdges, KeepACorner) {
  const auto row = [](float u) { return u < 160.0f ? 150.0f - 0.3f * u : 102.0f + 0.4f * (u - 160.0f); };
  const Boundary boundary = weakBoundary(row);
  WeakEdges weak(25, 2.0f, 5.0f, kShared_px);
  const auto& edges = weak.smooth(boundary.ends, boundary.edges);
  for (std::size_t u = 150; u < 170; ++u) EXPECT_NEAR(edges[u].row, row(static_cast<float>(u)), 2.5f) << u;
  EXPECT_LT(rmsOf(edges, row), 0.35f);
}

TEST(WeakEdges, HaveAtLeastTheErrorThatTextureGivesToAll) {
  const Boundary boundary = weakBoundary([](float) { return 120.0f; });
  WeakEdges weak(25, 2.0f, 5.0f, kShared_px);
  for (const auto& edge : weak.smooth(boundary.ends, boundary.edges)) {
    EXPECT_GE(edge.sigma_px, kShared_px);
    EXPECT_LT(edge.sigma_px, 0.7f);
  }
}

TEST(WeakEdges, WithoutALineAreDropped) {
  std::mt19937 random(12);
  std::uniform_real_distribution<float> anywhere(60.0f, 200.0f);
  Boundary boundary = weakBoundary([](float) { return 120.0f; });
  for (auto& edge : boundary.edges) edge.row = anywhere(random);
  WeakEdges weak(25, 2.0f, 5.0f, kShared_px);
  for (const auto& edge : weak.smooth(boundary.ends, boundary.edges)) EXPECT_TRUE(std::isnan(edge.row));
}

TEST(WeakEdges, LeaveClearEdgesAsTheyAre) {
  Boundary boundary = weakBoundary([](float) { return 120.0f; });
  for (std::size_t u = 0; u < 100; ++u) boundary.ends[u].weak = false;
  WeakEdges weak(25, 2.0f, 5.0f, kShared_px);
  const auto& edges = weak.smooth(boundary.ends, boundary.edges);
  for (std::size_t u = 0; u < 100; ++u) {
    EXPECT_EQ(edges[u].row, boundary.edges[u].row);
    EXPECT_EQ(edges[u].sigma_px, boundary.edges[u].sigma_px);
  }
}

}  // namespace
}  // namespace omnifleet::distance_vector
