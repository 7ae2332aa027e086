// Compact views, the exploration grid, frontiers and their assignment.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <random>
#include <set>

#include "motion/exploration.h"
#include "motion/frontier_assignment.h"
#include "motion/view.h"

namespace omnifleet::motion {
namespace {

constexpr int kRays = 360;

/// A scan of 90° in a square room of 2 m about the origin.
Scan scanFrom(const Pose2& pose, double blind_m = 0.0) {
  Scan scan;
  scan.blind_m = blind_m;
  scan.range_m.assign(kRays, 0.0f);
  scan.sigma_m.assign(kRays, 0.001f);
  scan.label.assign(kRays, RayLabel::kInvalid);
  for (int i = 0; i < kRays; ++i) {
    const double bearing_rad = wrapAngle(2.0 * M_PI * i / kRays);
    if (std::abs(bearing_rad) > M_PI_4 + 1e-9) continue;
    const Eigen::Vector2d unit(std::cos(pose.theta_rad + bearing_rad),
                               std::sin(pose.theta_rad + bearing_rad));
    double range_m = 10.0;
    for (int axis = 0; axis < 2; ++axis) {
      if (std::abs(unit[axis]) > 1e-9)
        range_m = std::min(range_m, (std::copysign(1.0, unit[axis]) - pose.translation()[axis]) / unit[axis]);
    }
    scan.range_m[static_cast<std::size_t>(i)] = static_cast<float>(std::max(range_m, blind_m));
    scan.label[static_cast<std::size_t>(i)] = RayLabel::kObstacle;
  }
  return scan;
}

ExplorationGrid::Options smallGrid() {
  ExplorationGrid::Options options;
  options.size_m = {2.4, 2.4};
  return options;
}

TEST(View, KeepsTheFieldOfViewAcrossBearingZeroInNinetyOneEntries) {
  const View view = compactView(scanFrom({}), 0.02);
  ASSERT_EQ(view.ray.size(), 91u);
  EXPECT_NEAR(view.bearing_rad(0), 2.0 * M_PI - M_PI_4, 1e-5);
  EXPECT_NEAR(fieldOfView(view), M_PI_2, 1e-5);
  for (std::size_t i = 0; i < view.ray.size(); ++i) {
    EXPECT_EQ(view.kind(i), View::kSolid);
    const double expected_m = 1.0 / std::cos(view.bearing_rad(i));
    EXPECT_NEAR(view.range_m(i), expected_m, 0.6e-3) << "one millimetre per unit";
  }
}

TEST(View, JoinsRaysOfAFullScanAndKeepsTheNearest) {
  Scan scan;
  scan.range_m.assign(720, 2.0f);
  scan.sigma_m.assign(720, 0.001f);
  scan.label.assign(720, RayLabel::kFloorEnd);
  scan.range_m[101] = 0.7f;
  scan.label[101] = RayLabel::kObstacle;
  const View view = compactView(scan, 0.02);
  ASSERT_EQ(view.ray.size(), 90u);
  const std::size_t at = 101 / 8;
  EXPECT_EQ(view.kind(at), View::kSolid);
  EXPECT_NEAR(view.range_m(at), 0.7, 1e-3);
  EXPECT_EQ(view.kind(at + 1), View::kFree);
}

TEST(View, DistinguishesRobotsUncertainAndHiddenObjects) {
  Scan scan = scanFrom({}, 0.3);
  scan.label[0] = RayLabel::kRobot;
  scan.sigma_m[1] = 0.1f;
  scan.range_m[2] = 0.3f;
  const View view = compactView(scan, 0.02);
  const std::size_t middle = 45;
  EXPECT_EQ(view.kind(middle), View::kFree);
  EXPECT_EQ(view.kind(middle + 1), View::kFree);
  EXPECT_NEAR(view.range_m(middle + 1), 0.7, 2e-3) << "three sigma before the object";
  EXPECT_EQ(view.kind(middle + 2), View::kSolidNear);
  EXPECT_EQ(view.kind(middle + 3), View::kSolid);
}

TEST(ExplorationGrid, IsFreeBeforeTheWallOccupiedAtItAndUnknownBehindAndBeside) {
  ExplorationGrid grid(smallGrid());
  for (int i = 0; i < 3; ++i) grid.see({}, compactView(scanFrom({}), 0.02), {});
  const auto at = [&](double x, double y) { return grid.at(grid.cellOf({x, y})); };
  EXPECT_EQ(at(0.5, 0.0), Cell::kFree);
  EXPECT_EQ(at(0.9, 0.5), Cell::kFree);
  EXPECT_EQ(at(1.001, 0.1), Cell::kOccupied);
  EXPECT_EQ(at(1.1, 0.0), Cell::kUnknown);
  EXPECT_EQ(at(0.0, 0.6), Cell::kUnknown);
  EXPECT_EQ(at(-0.5, 0.0), Cell::kUnknown);
}

TEST(ExplorationGrid, RobotsAreNotSolid) {
  ExplorationGrid grid(smallGrid());
  const Polygon robot{{0.95, -0.1}, {1.1, -0.1}, {1.1, 0.1}, {0.95, 0.1}};
  for (int i = 0; i < 3; ++i) grid.see({}, compactView(scanFrom({}), 0.02), {robot});
  grid.stand(robot);
  EXPECT_EQ(grid.at(grid.cellOf({1.001, 0.0})), Cell::kFree);
  EXPECT_EQ(grid.at(grid.cellOf({1.001, 0.3})), Cell::kOccupied);
}

TEST(ExplorationGrid, KeepsAnObstacleInTheFloorThatTheBodyHides) {
  ExplorationGrid grid(smallGrid());
  for (int i = 0; i < 3; ++i) grid.see({}, compactView(scanFrom({}), 0.02), {});
  // The wall is now within the hidden floor; the rays that pass over it show something behind.
  Scan over = scanFrom({0.7, 0.0, 0.0}, 0.4);
  for (float& range_m : over.range_m) range_m += 0.5f;
  for (int i = 0; i < 20; ++i) grid.see({0.7, 0.0, 0.0}, compactView(over, 0.02), {});
  EXPECT_EQ(grid.at(grid.cellOf({1.001, 0.0})), Cell::kOccupied);
}

TEST(ExplorationGrid, EqualViewsGiveEqualGridsWhateverTheOrderOfRobots) {
  ExplorationGrid a(smallGrid()), b(smallGrid());
  for (ExplorationGrid* grid : {&a, &b}) {
    for (double theta_rad : {0.0, 1.5, 3.0})
      grid->see({0.1, 0.2, theta_rad}, compactView(scanFrom({0.1, 0.2, theta_rad}), 0.02), {});
  }
  EXPECT_EQ(cv::norm(a.cells(), b.cells(), cv::NORM_INF), 0.0);
}

TEST(Frontiers, LieAtTheSidesOfTheViewAndVanishAfterAFullTurn) {
  ExplorationGrid grid(smallGrid());
  grid.assumeFree({0.0, 0.0}, 0.15);
  grid.see({}, compactView(scanFrom({}), 0.02), {});
  const std::vector<Frontier> frontiers = findFrontiers(grid, 0.5, 4);
  ASSERT_FALSE(frontiers.empty());
  for (const Frontier& frontier : frontiers) {
    EXPECT_LT(frontier.place_m.x(), 1.05);
    for (const Eigen::Vector2i& cell : frontier.cells) EXPECT_EQ(grid.at(cell), Cell::kUnknown);
    const Eigen::Vector2i low = *std::min_element(frontier.cells.begin(), frontier.cells.end(),
                                                  [](const auto& p, const auto& q) { return p.x() < q.x(); });
    const Eigen::Vector2i high =
        *std::max_element(frontier.cells.begin(), frontier.cells.end(),
                          [](const auto& p, const auto& q) { return p.x() < q.x(); });
    EXPECT_LE(grid.cell_m() * (high.x() - low.x()), 0.5);
  }
  for (double theta_rad = 0.0; theta_rad < 6.3; theta_rad += 0.3)
    for (int i = 0; i < 2; ++i)
      grid.see({0, 0, theta_rad}, compactView(scanFrom({0, 0, theta_rad}), 0.02), {});
  EXPECT_TRUE(findFrontiers(grid, 0.5, 4).empty());
}

TEST(Frontiers, ViewpointsSeeTheFrontierPastNoObstacleAndFaceIt) {
  ExplorationGrid grid(smallGrid());
  for (int i = 0; i < 3; ++i) grid.see({}, compactView(scanFrom({}), 0.02), {});
  const std::vector<Frontier> frontiers = findFrontiers(grid, 0.5, 4);
  cv::Mat1b standable, opaque = cv::Mat1b::zeros(grid.size());
  cv::compare(grid.cells(), static_cast<int>(Cell::kFree), standable, cv::CMP_EQ);
  int found = 0;
  for (const Frontier& frontier : frontiers) {
    for (const Viewpoint& view : viewpointsOf(frontier, grid, standable, opaque, {}, {})) {
      ++found;
      EXPECT_EQ(grid.at(view.cell), Cell::kFree);
      const Eigen::Vector2d way_m = frontier.place_m - grid.centreOf(view.cell);
      if (view.seen < 0.5) continue;
      EXPECT_LT(std::abs(wrapAngle(std::atan2(way_m.y(), way_m.x()) - view.heading_rad)), M_PI_2);
      EXPECT_LE(view.seen, 1.0 + 1e-9);
    }
  }
  EXPECT_GT(found, 20);
}

/// The room seen all around from its middle, with a gap in the wall at x = 1 m and 20 cm of floor behind it.
ExplorationGrid roomWithGap(double gap_m) {
  ExplorationGrid::Options options;
  options.size_m = {2.8, 2.4};
  ExplorationGrid grid(options);
  for (double theta_rad = 0.0; theta_rad < 12.5; theta_rad += 0.3) {
    const Pose2 pose{0.0, 0.0, theta_rad};
    Scan scan = scanFrom(pose);
    for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
      const double heading_rad = theta_rad + 2.0 * M_PI * static_cast<double>(i) / kRays;
      const bool ahead = std::cos(heading_rad) > 0.1;
      if (!ahead || std::abs(std::tan(heading_rad)) >= 0.5 * gap_m) continue;
      if (scan.label[i] != RayLabel::kObstacle) continue;
      scan.range_m[i] *= 1.2f;
      scan.label[i] = RayLabel::kFloorEnd;
    }
    grid.see(pose, compactView(scan, 0.02), {});
  }
  return grid;
}

TEST(Exploration, LeavesOutFloorBehindAGapThatIsTooNarrowForTheBody) {
  Explorer robot;
  robot.name = "r1";
  robot.radius_m = 0.11;
  robot.outline_m = circlePolygon({0.0, 0.0}, 0.11, 16);
  robot.explores = true;
  robot.field_of_view_rad = M_PI_2;
  for (const double gap_m : {0.09, 0.50}) {
    const ExplorationGrid grid = roomWithGap(gap_m);
    EXPECT_EQ(grid.at(grid.cellOf({1.1, 0.0})), Cell::kFree) << "the floor behind the gap is seen";
    EXPECT_FALSE(findFrontiers(grid, 0.5, 1).empty()) << gap_m;
    Exploration::Options options;
    options.least_cells = 1;
    Exploration exploration(options);
    const Exploration::Plan plan = exploration.plan(grid, {robot}, 0, {});
    EXPECT_EQ(plan.frontiers.empty(), gap_m < 0.2) << gap_m;
    EXPECT_EQ(plan.own.has_value(), gap_m > 0.2) << gap_m;
  }
}

double costOf(const std::vector<std::vector<double>>& times_s, const std::vector<int>& frontier_of) {
  double sum_s = 0.0;
  for (std::size_t i = 0; i < frontier_of.size(); ++i)
    sum_s += frontier_of[i] < 0 ? 1e6 : times_s[i][static_cast<std::size_t>(frontier_of[i])];
  return sum_s;
}

TEST(FrontierAssignment, NeverGivesOneFrontierToTwoRobotsAndIsNearTheBestOfAll) {
  std::mt19937 random(5);
  std::uniform_real_distribution<double> uniform(0.0, 30.0);
  double sum_s = 0.0, best_sum_s = 0.0;
  for (int round = 0; round < 200; ++round) {
    const std::size_t robots = 3, frontiers = 1 + static_cast<std::size_t>(round) % 5;
    std::vector<std::vector<double>> times_s(robots, std::vector<double>(frontiers));
    std::vector<Eigen::Vector2d> places_m;
    for (auto& row : times_s)
      for (double& time_s : row) time_s = uniform(random) > 27.0 ? INFINITY : uniform(random);
    for (std::size_t j = 0; j < frontiers; ++j) places_m.emplace_back(uniform(random), uniform(random));
    const std::vector<int> result = assignFrontiers(times_s, places_m, 0.0, 1.0);
    std::set<int> given;
    for (std::size_t i = 0; i < robots; ++i) {
      if (result[i] < 0) continue;
      EXPECT_TRUE(given.insert(result[i]).second) << "round " << round;
      EXPECT_TRUE(std::isfinite(times_s[i][static_cast<std::size_t>(result[i])]));
    }
    // Exhaustive search.
    double least_s = INFINITY;
    const int n = static_cast<int>(frontiers);
    for (int a = -1; a < n; ++a)
      for (int b = -1; b < n; ++b)
        for (int c = -1; c < n; ++c) {
          if ((a >= 0 && (a == b || a == c)) || (b >= 0 && b == c)) continue;
          least_s = std::min(least_s, costOf(times_s, {a, b, c}));
        }
    if (std::isfinite(least_s) && least_s < 1e6) {
      sum_s += costOf(times_s, result);
      best_sum_s += least_s;
    }
  }
  EXPECT_LT(sum_s, 1.05 * best_sum_s);
}

TEST(FrontierAssignment, SpreadsRobotsAndBreaksTiesByOrder) {
  const std::vector<Eigen::Vector2d> places_m{{0.0, 0.0}, {0.1, 0.0}, {3.0, 0.0}};
  // Both robots are nearest to the first two, which lie side by side.
  const std::vector<std::vector<double>> times_s{{1.0, 2.0, 6.0}, {1.0, 2.0, 6.0}};
  EXPECT_EQ(assignFrontiers(times_s, places_m, 8.0, 1.5), (std::vector<int>{0, 2}));
  EXPECT_EQ(assignFrontiers({{1.0}, {1.0}}, {{0.0, 0.0}}, 8.0, 1.5), (std::vector<int>{0, -1}));
}

}  // namespace
}  // namespace omnifleet::motion
