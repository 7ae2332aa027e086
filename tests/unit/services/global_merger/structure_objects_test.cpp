// Polylines of the map's cells as objects beside the fitted obstacles.

#include "global_merger/structure_objects.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet::global_merger {
namespace {

using ::testing::ElementsAre;

structure::Polyline openLine(const std::vector<Eigen::Vector2d>& points_m) {
  structure::Polyline line;
  line.points_m = points_m;
  line.sigma_m = 0.003;
  line.observations = 4;
  line.observers = 1;
  return line;
}

structure::Polyline closedLine(const std::vector<Eigen::Vector2d>& points_m) {
  structure::Polyline line = openLine(points_m);
  line.closed = true;
  return line;
}

/// A fitted obstacle of 1 × 1 m with its lower left corner at zero.
dataset::MapObject fittedBox() {
  dataset::MapObject box;
  box.id = 3;
  box.outline_m = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  box.centroid_m = {0.5, 0.5};
  return box;
}

TEST(StructureObjects, KeepAnOpenLineAsStructure) {
  const auto objects = structureObjects({openLine({{0, 0}, {2, 0}, {2, 1}})}, {}, {}, {"r1"});
  ASSERT_EQ(objects.size(), 1U);
  EXPECT_EQ(objects[0].kind, "structure");
  EXPECT_TRUE(objects[0].isOpen());
  EXPECT_EQ(objects[0].id, kFirstStructureId);
  EXPECT_THAT(objects[0].outline_m,
              ElementsAre(Eigen::Vector2d(0, 0), Eigen::Vector2d(2, 0), Eigen::Vector2d(2, 1)));
  // Middle of its length: (2·(1, 0) + 1·(2, 0.5)) / 3.
  EXPECT_NEAR((objects[0].centroid_m - Eigen::Vector2d(4.0 / 3.0, 0.5 / 3.0)).norm(), 0.0, 1e-12);
  EXPECT_EQ(objects[0].observations, 4);
  EXPECT_NEAR(objects[0].covariance_m2(0, 0), 9e-6, 1e-12);
  EXPECT_NEAR(objects[0].covariance_m2(1, 1), 9e-6, 1e-12);
  EXPECT_EQ(objects[0].covariance_m2(0, 1), 0.0);
}

TEST(StructureObjects, AreObstaclesWhereALineIsClosedAroundACandidateThatStandsThere) {
  const auto objects =
      structureObjects({openLine({{5, 0}, {6, 0}}), closedLine({{0, 0}, {2, 0}, {2, 1}, {0, 1}})}, {},
                       {{5.5, 0.0}, {0.5, 0.5}}, {"r1"});
  ASSERT_EQ(objects.size(), 2U);
  EXPECT_EQ(objects[0].kind, "structure") << "open";
  EXPECT_EQ(objects[1].kind, "obstacle");
  EXPECT_FALSE(objects[1].isOpen());
  EXPECT_EQ(objects[1].id, kFirstStructureId + 1);
  EXPECT_EQ(objects[1].outline_m.size(), 4U);
  EXPECT_EQ(objects[1].centroid_m, Eigen::Vector2d(1.0, 0.5));
}

TEST(StructureObjects, AreStructureWhereAClosedLineContainsNoCandidateThatStandsThere) {
  const structure::Polyline box = closedLine({{0, 0}, {2, 0}, {2, 1}, {0, 1}});
  const auto inside = structureObjects({box}, {}, {{2.5, 0.5}}, {"r1"});
  ASSERT_EQ(inside.size(), 1U);
  EXPECT_EQ(inside[0].kind, "structure") << "a candidate beside it";
  EXPECT_EQ(inside[0].outline_m.size(), 5U) << "the line returns to its first point";
  EXPECT_EQ(inside[0].outline_m.front(), inside[0].outline_m.back());
  EXPECT_EQ(inside[0].centroid_m, Eigen::Vector2d(1.0, 0.5));
}

TEST(StructureObjects, LeaveOutLinesOfFittedObstacles) {
  const auto count = [](const structure::Polyline& line) {
    return structureObjects({line}, {fittedBox()}, {}, {"r1"}).size();
  };
  EXPECT_EQ(count(openLine({{0.1, -0.07}, {0.9, -0.07}})), 0U);
  EXPECT_EQ(count(openLine({{0.1, -0.08}, {0.9, -0.08}})), 1U) << "farther than 7.5 cm";
  EXPECT_EQ(count(closedLine({{-0.05, -0.05}, {1.05, -0.05}, {1.05, 1.05}, {-0.05, 1.05}})), 0U);
  EXPECT_EQ(count(openLine({{0.2, 0.5}, {0.8, 0.5}})), 0U) << "within the outline";
  // A line that continues beyond the obstacle belongs to it while most of it does.
  EXPECT_EQ(count(openLine({{0, 0}, {1.8, 0}})), 0U);
  EXPECT_EQ(count(openLine({{0, 0}, {2.4, 0}})), 1U);
  // The last piece of a closed line counts too: 3.15 m of 5.4 m without it, of 6.4 m with it.
  EXPECT_EQ(count(closedLine({{0, 2.2}, {0, 0}, {1, 0}, {1, 2.2}})), 1U);
  EXPECT_EQ(count(closedLine({{0, 1}, {0, 0}, {1, 0}, {1, 1}})), 0U);
}

TEST(StructureObjects, BelongToAnyOfSeveralObstacles) {
  dataset::MapObject neighbour = fittedBox();
  for (Eigen::Vector2d& p : neighbour.outline_m) p.x() += 1.0;
  const structure::Polyline along = openLine({{0, 0}, {2, 0}});
  EXPECT_EQ(structureObjects({along}, {fittedBox(), neighbour}, {}, {"r1"}).size(), 0U);
}

TEST(StructureObjects, HaveTheRobotsOfTheirBitsAsObservers) {
  structure::Polyline line = openLine({{0, 0}, {2, 0}});
  line.observers = 0b101;
  EXPECT_THAT(structureObjects({line}, {}, {}, {"r1", "r2", "r3"}).front().observers,
              ElementsAre("r1", "r3"));
  line.observers = 0b10;
  EXPECT_THAT(structureObjects({line}, {}, {}, {"r1", "r2", "r3"}).front().observers, ElementsAre("r2"));
}

TEST(StructureObjects, NeedTwoPoints) {
  EXPECT_TRUE(structureObjects({openLine({}), openLine({{1, 1}})}, {}, {}, {"r1"}).empty());
}

TEST(StructureObjects, NeedTheLeastNumberOfKeyframesAndShareTheErrorOfThePose) {
  structure::Polyline line = openLine({{0, 0}, {2, 0}});
  line.observations = 2;
  line.sigma_m = 0.003;
  EXPECT_TRUE(structureObjects({line}, {}, {}, {"r1"}, {0.004, 3}).empty());
  line.observations = 3;
  const auto objects = structureObjects({line}, {}, {}, {"r1"}, {0.004, 3});
  ASSERT_EQ(objects.size(), 1U);
  EXPECT_NEAR(objects[0].covariance_m2(0, 0), 25e-6, 1e-9);
}

}  // namespace
}  // namespace omnifleet::global_merger
