#include "evaluation/map_metrics.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace omnifleet::evaluation {
namespace {

using ::testing::ElementsAre;

dataset::MapObject box(double x, double y, double side = 0.2, const char* kind = "obstacle") {
  dataset::MapObject object;
  const double h = 0.5 * side;
  object.outline_m = {{x - h, y - h}, {x + h, y - h}, {x + h, y + h}, {x - h, y + h}};
  object.kind = kind;
  return object;
}

TEST(CompareMaps, MatchesErrorsInClosedForm) {
  const std::vector<dataset::MapObject> truth{box(0, 0), box(1, 0), box(0, 2)};
  const std::vector<dataset::MapObject> got{box(0.01, 2.0), box(0.02, -0.01), box(1.0, 0.04)};
  const MapMetrics m = compareMaps(truth, got, {});
  EXPECT_EQ(m.matches.size(), 3u);
  EXPECT_EQ(m.recall, 1.0);
  EXPECT_EQ(m.precision, 1.0);
  EXPECT_NEAR(m.x_error_m, (0.02 + 0.0 + 0.01) / 3, 1e-12);
  EXPECT_NEAR(m.y_error_m, (0.01 + 0.04 + 0.0) / 3, 1e-12);
  EXPECT_EQ(m.matches[0].estimate, 1);
  EXPECT_NEAR(m.matches[1].dy_m, 0.04, 1e-12);
  const double overlap = 0.2 * 0.16;
  EXPECT_NEAR(m.matches[1].iou, overlap / (0.08 - overlap), 1e-5);
  const auto distance = [](double x, double y) { return std::hypot(x, y); };
  const double expected = (std::abs(distance(0.98, 0.05) - 1.0) + std::abs(distance(0.01, 2.01) - 2.0) +
                           std::abs(distance(0.99, 1.96) - std::sqrt(5.0))) /
                          3.0;
  EXPECT_NEAR(m.distances_error_m, expected, 1e-12);
}

TEST(CompareMaps, MatchesOnlyWithinGateAndWithOverlap) {
  // 0.16 m apart: beyond the gate. 0.14 m apart: the IoU of 0.2 m boxes is 0.06/0.34, too little; that of 0.6
  // m boxes is enough.
  EXPECT_EQ(compareMaps({box(0, 0, 0.6)}, {box(0.16, 0, 0.6)}, {}).matches.size(), 0u);
  EXPECT_EQ(compareMaps({box(0, 0, 0.2)}, {box(0.14, 0, 0.2)}, {}).matches.size(), 0u);
  EXPECT_EQ(compareMaps({box(0, 0, 0.6)}, {box(0.14, 0, 0.6)}, {}).matches.size(), 1u);
  EXPECT_EQ(compareMaps({box(0, 0, 0.2)}, {box(0, 0, 0.1)}, {}).matches.size(), 0u) << "IoU 0.25";
}

TEST(CompareMaps, ListsMissedAndFalseAndIgnoresRobots) {
  const std::vector<dataset::MapObject> truth{box(0, 0), box(1, 0), box(5, 5, 0.2, "robot")};
  const std::vector<dataset::MapObject> got{box(3, 3), box(1, 0), box(9, 9, 0.3, "robot")};
  const MapMetrics m = compareMaps(truth, got, {});
  EXPECT_THAT(m.missed, ElementsAre(0));
  EXPECT_THAT(m.falsely_found, ElementsAre(0));
  EXPECT_EQ(m.truths, 2);
  EXPECT_EQ(m.estimates, 2);
  EXPECT_EQ(m.recall, 0.5);
  EXPECT_EQ(m.precision, 0.5);
  EXPECT_TRUE(std::isnan(m.distances_error_m)) << "one match gives no pair of distances";
}

TEST(CompareMaps, ListsMissedObstaclesThatAreDrawnAsStructure) {
  dataset::MapObject front;
  front.kind = "structure";
  front.outline_m = {{-0.1, -0.13}, {0.1, -0.13}};  // 3 cm before one side of the first box
  const std::vector<dataset::MapObject> truth{box(0, 0), box(1, 0)};
  const MapMetrics m = compareMaps(truth, {front}, {});
  EXPECT_THAT(m.missed, ElementsAre(0, 1));
  EXPECT_THAT(m.drawn_as_structure, ElementsAre(0));
  EXPECT_TRUE(m.falsely_found.empty());
  front.outline_m = {{-0.1, -0.17}, {0.1, -0.17}};
  EXPECT_TRUE(compareMaps(truth, {front}, {}).drawn_as_structure.empty()) << "7 cm away";
}

TEST(CompareMaps, CountsDuplicateObjectAsFalse) {
  const MapMetrics m = compareMaps({box(0, 0)}, {box(0.02, 0), box(0.01, 0)}, {});
  ASSERT_EQ(m.matches.size(), 1u);
  EXPECT_EQ(m.matches[0].estimate, 1) << "the nearer estimate";
  EXPECT_THAT(m.falsely_found, ElementsAre(0));
}

TEST(CompareMaps, ReturnsFullRecallForEmptyMaps) {
  const MapMetrics m = compareMaps({}, {}, {});
  EXPECT_EQ(m.recall, 1.0);
  EXPECT_EQ(m.precision, 1.0);
  EXPECT_TRUE(std::isnan(m.x_error_m));
}

}  // namespace
}  // namespace omnifleet::evaluation
