// How well two sets of scans agree: lengths of surfaces, by exact scans of polygons.
#include "scan/map_overlap.h"

#include <gtest/gtest.h>

#include <random>
#include <vector>

#include "tests/unit/scan/room_scans.h"

namespace omnifleet::scan {
namespace {

using testing::Scene;

constexpr double kOverlapSigma = 0.003;  // 1/m, of the inverse range: 1 cm at 1.8 m

Polygon rectangle(double x0, double y0, double x1, double y1) {
  return {{x0, y0}, {x1, y0}, {x1, y1}, {x0, y1}};
}

struct Scans {
  std::vector<LineScan> scans;
  std::vector<Pose2> poses;

  Scans(const Scene& scene, const std::vector<Pose2>& at, std::uint32_t seed) : poses(at) {
    std::mt19937 random(seed);
    for (const Pose2& pose : at) {
      scans.emplace_back();
      scans.back().fit(scene.scan(pose, kOverlapSigma, random));
    }
  }
  std::vector<Reference> references(const Pose2& moved = {}) const {
    std::vector<Reference> all;
    for (std::size_t i = 0; i < scans.size(); ++i) all.push_back({&scans[i], moved * poses[i]});
    return all;
  }
};

const std::vector<Pose2> kWest{{-1.5, 0.3, 0.4}, {-1.0, 0.0, 1.0}, {-0.5, 0.5, -2.0}};
const std::vector<Pose2> kEast{{1.5, 0.3, -0.7}, {1.2, -0.8, 2.0}, {0.3, -0.9, 0.0}};

TEST(MapOverlap, AgreesInOneRoom) {
  const Scene room = testing::furnishedRoom();
  const Overlap overlap =
      overlapOf(Scans(room, kWest, 1).references(), Scans(room, kEast, 2).references(), {});
  // Perimeter 18 m; both sets see most of it, and some furniture.
  EXPECT_GT(overlap.agree_m, 10.0);
  EXPECT_LT(overlap.contradiction(), 0.02);
  EXPECT_GT(overlap.normals.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0.3);
}

TEST(MapOverlap, ContradictsWhereFurnitureDiffers) {
  const Scene room = testing::furnishedRoom();
  Scene other = room;
  other.outlines.resize(1);  // the walls
  other.outlines.push_back(rectangle(-2.5, -2.0, -1.2, -1.4));
  other.outlines.push_back(rectangle(0.2, -0.6, 0.8, 0.2));
  const Overlap overlap =
      overlapOf(Scans(room, kWest, 1).references(), Scans(other, kEast, 2).references(), {});
  // The walls agree, six pieces of furniture of 0.6 m and more do not.
  EXPECT_GT(overlap.agree_m, 5.0);
  EXPECT_GT(overlap.contradict_m, 2.0);
}

TEST(MapOverlap, ContradictsAtAWrongRelation) {
  const Scene room = testing::furnishedRoom();
  const Scans west(room, kWest, 1), east(room, kEast, 2);
  const Overlap turned = overlapOf(west.references(), east.references({0.0, 0.0, M_PI}), {}),
                shifted = overlapOf(west.references(), east.references({0.4, 0.0, 0.0}), {});
  EXPECT_GT(turned.contradiction(), 0.15);
  EXPECT_GT(shifted.contradiction(), 0.25);
}

TEST(MapOverlap, SaysNothingAboutPlacesThatOnlyOneSetHasSeen) {
  // Two rooms side by side: neither robot sees the other's.
  const Scene left{{rectangle(-4.0, -1.5, 0.0, 1.5)}}, right{{rectangle(0.3, -1.5, 4.3, 1.5)}};
  const Overlap overlap = overlapOf(Scans(left, {{-2.0, 0.0, 0.0}}, 1).references(),
                                    Scans(right, {{2.0, 0.0, 0.0}}, 2).references(), {});
  // The two sides of the wall between them are 30 cm apart.
  EXPECT_LT(overlap.agree_m, 0.3);
  EXPECT_LT(overlap.contradict_m, 0.2);
}

TEST(MapOverlap, NormalsDistinguishACorridor) {
  const Scene corridor = testing::corridor();
  const Overlap overlap = overlapOf(Scans(corridor, {{0.0, 0.0, 0.0}}, 1).references(),
                                    Scans(corridor, {{1.0, 0.2, 0.0}}, 2).references(), {});
  EXPECT_GT(overlap.agree_m, 2.0);
  EXPECT_LT(overlap.normals.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff(), 0.02);
}

}  // namespace
}  // namespace omnifleet::scan
