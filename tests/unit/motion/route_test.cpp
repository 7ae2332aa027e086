#include "motion/route.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace omnifleet::motion {
namespace {

constexpr double kRadiusM = 0.15;
constexpr int kRays = 720;

/// A wall between two points.
struct Wall {
  Eigen::Vector2d a_m, b_m;
};

/// Distance at which a unit ray meets a wall; infinity if it does not.
double meets(const Eigen::Vector2d& from_m, const Eigen::Vector2d& unit, const Wall& wall) {
  Eigen::Matrix2d sides;
  sides << unit, wall.a_m - wall.b_m;
  if (std::abs(sides.determinant()) < 1e-9) return INFINITY;
  const Eigen::Vector2d at = sides.inverse() * (wall.a_m - from_m);
  return at.x() > 0.0 && at.y() >= 0.0 && at.y() <= 1.0 ? at.x() : INFINITY;
}

Scan scanOf(const std::vector<Wall>& walls, const Pose2& map_from_base,
            RayLabel label = RayLabel::kObstacle) {
  Scan scan;
  for (int i = 0; i < kRays; ++i) {
    const double bearing_rad = map_from_base.theta_rad + 2.0 * M_PI * i / kRays;
    const Eigen::Vector2d unit(std::cos(bearing_rad), std::sin(bearing_rad));
    double range_m = INFINITY;
    for (const Wall& wall : walls)
      range_m = std::min(range_m, meets(map_from_base.translation(), unit, wall));
    const bool hit = range_m < 2.5;
    scan.range_m.push_back(static_cast<float>(hit ? range_m : 2.5));
    scan.label.push_back(hit ? label : RayLabel::kFloorEnd);
    scan.sigma_m.push_back(0.005f);
    scan.object.push_back(0);
  }
  return scan;
}

void observe(FloorMemory& floor, const std::vector<Wall>& walls, const Pose2& map_from_base, int times = 2,
             RayLabel label = RayLabel::kObstacle) {
  for (int i = 0; i < times; ++i) floor.see(map_from_base, scanOf(walls, map_from_base, label));
}

double toWall(const Eigen::Vector2d& place_m, const Wall& wall) {
  const Eigen::Vector2d way = wall.b_m - wall.a_m;
  const double along = std::clamp((place_m - wall.a_m).dot(way) / way.squaredNorm(), 0.0, 1.0);
  return (place_m - wall.a_m - along * way).norm();
}

const Wall kAcross{{1.0, -0.8}, {1.0, 0.8}};

TEST(FloorMemory, ReportsDistanceToObstacles) {
  FloorMemory floor({});
  const Pose2 stand{0.3, 0.1, 0.7};
  observe(floor, {kAcross}, stand);
  // The place and the wall each lie within half a diagonal of the centre of their cell.
  const double within_m = floor.cell_m() * M_SQRT2;
  for (const Eigen::Vector2d& place_m :
       {Eigen::Vector2d(0.4, 0.0), Eigen::Vector2d(1.6, 0.3), Eigen::Vector2d(1.0, 1.5)})
    EXPECT_NEAR(floor.clearanceAt(place_m), toWall(place_m, kAcross), within_m);
}

TEST(FloorMemory, RequiresTwoHitsForAnOccupiedCell) {
  FloorMemory floor({});
  observe(floor, {kAcross}, {}, 1);
  EXPECT_GT(floor.clearanceAt({1.0, 0.0}), 1.0);
  observe(floor, {kAcross}, {}, 1);
  EXPECT_LT(floor.clearanceAt({1.0, 0.0}), 0.1);
}

TEST(FloorMemory, FreesCellsWhereFloorIsSeenAgain) {
  FloorMemory floor({});
  observe(floor, {kAcross}, {}, 20);
  observe(floor, {}, {}, 10);
  EXPECT_GT(floor.clearanceAt({1.0, 0.0}), 1.0);
}

TEST(FloorMemory, KeepsHiddenObstacles) {
  FloorMemory floor({});
  const Wall before{{0.5, -0.8}, {0.5, 0.8}};
  observe(floor, {kAcross}, {});
  observe(floor, {before}, {}, 20);
  EXPECT_LT(floor.clearanceAt({1.0, 0.0}), 0.1);
}

TEST(FloorMemory, KeepsObstaclesInTheBlindZone) {
  FloorMemory floor({});
  observe(floor, {kAcross}, {});
  Scan blind = scanOf({}, {0.8, 0.0, 0.0});
  blind.blind_m = 0.42;
  for (int i = 0; i < 20; ++i) floor.see({0.8, 0.0, 0.0}, blind);
  EXPECT_LT(floor.clearanceAt({1.0, 0.0}), 0.1) << "0.2 m from the camera is inside the blind zone";
}

TEST(FloorMemory, IgnoresRobotsAndKeepsUnknownObjects) {
  FloorMemory floor({});
  observe(floor, {kAcross}, {}, 5, RayLabel::kRobot);
  EXPECT_GT(floor.clearanceAt({1.0, 0.0}), 1.0);
  observe(floor, {kAcross}, {}, 2, RayLabel::kUnknown);
  EXPECT_LT(floor.clearanceAt({1.0, 0.0}), 0.1) << "an object of unknown kind is solid";
  floor.clear({1.0, 0.0}, 0.3);
  EXPECT_NEAR(floor.clearanceAt({1.0, 0.0}), 0.3, 0.08) << "the robot at that place has been cleared";
}

TEST(FloorMemory, MovesWindowAndForgetsWhatLeavesIt) {
  FloorMemory::Options options;
  options.window_m = 6.0;
  FloorMemory floor(options);
  observe(floor, {kAcross}, {});
  observe(floor, {kAcross}, {2.4, 2.0, 0.0});
  EXPECT_LT(floor.clearanceAt({1.0, 0.8}), 0.1);
  observe(floor, {}, {5.0, 0.0, 0.0});
  EXPECT_GT(floor.clearanceAt({1.0, 0.0}), 1.0);
  observe(floor, {}, {0.0, 3.0, 0.0});
  EXPECT_GT(floor.clearanceAt({1.0, 0.0}), 1.0) << "the wall that left the window must not reappear";
}

TEST(GridSearch, FindsCheapestPathAroundForbiddenCells) {
  cv::Mat1f price(20, 20, 1.0f);
  for (int row = 0; row < 15; ++row) price(row, 10) = INFINITY;
  GridSearch search;
  const GridSearch::Result& found = search.find(price, {5, 5}, {15, 5});
  EXPECT_TRUE(found.reaches);
  ASSERT_FALSE(found.cells.empty());
  EXPECT_EQ(found.cells.back(), Eigen::Vector2i(15, 5));
  for (const Eigen::Vector2i& cell : found.cells) EXPECT_TRUE(std::isfinite(price(cell.y(), cell.x())));
  // Five cells aside and ten down to the end of the wall, and back up. Diagonal steps cost √2.
  EXPECT_NEAR(found.cost, 2.0 * (5.0 * M_SQRT2 + 5.0), 1e-3);
}

TEST(GridSearch, PrefersLongerPathOfLowerCost) {
  cv::Mat1f price(9, 9, 1.0f);
  for (int row = 0; row < 8; ++row) price(row, 4) = 30.0f;
  GridSearch search;
  const GridSearch::Result& found = search.find(price, {0, 4}, {8, 4});
  for (const Eigen::Vector2i& cell : found.cells) EXPECT_EQ(price(cell.y(), cell.x()), 1.0f);
}

TEST(GridSearch, EndsAtNearestCellIfGoalIsUnreachable) {
  cv::Mat1f price(20, 20, 1.0f);
  for (int row = 0; row < 20; ++row) price(row, 10) = INFINITY;
  GridSearch search;
  const GridSearch::Result& found = search.find(price, {2, 2}, {15, 9});
  EXPECT_FALSE(found.reaches);
  ASSERT_FALSE(found.cells.empty());
  EXPECT_EQ(found.cells.back(), Eigen::Vector2i(9, 9));
  EXPECT_TRUE(search.find(price, {9, 9}, {15, 9}).cells.empty());
}

/// Moves along the legs as a robot without inertia would, with a scan at every step. Returns the least
/// distance to the walls.
double drive(Route& route, FloorMemory& floor, const std::vector<Wall>& walls, const Eigen::Vector2d& goal_m,
             Eigen::Vector2d& here_m, int steps) {
  double least_m = INFINITY;
  for (int i = 0; i < steps && (goal_m - here_m).norm() > 0.05; ++i) {
    observe(floor, walls, {here_m.x(), here_m.y(), 0.0}, 1);
    const Route::Leg leg = route.towards(floor, here_m, goal_m, kRadiusM);
    const Eigen::Vector2d way_m = leg.via_m - here_m;
    here_m += std::min(0.05, way_m.norm()) * way_m.normalized();
    for (const Wall& wall : walls) least_m = std::min(least_m, toWall(here_m, wall));
  }
  return least_m;
}

TEST(Route, DrivesStraightIfPathIsFree) {
  FloorMemory floor({});
  Route route({});
  observe(floor, {{{1.0, 0.5}, {1.0, 2.0}}}, {});
  const Route::Leg leg = route.towards(floor, {0.0, 0.0}, {3.0, 0.0}, kRadiusM);
  EXPECT_TRUE(leg.straight);
  EXPECT_EQ(leg.via_m, Eigen::Vector2d(3.0, 0.0));
}

TEST(Route, PassesAWallWithTheMargin) {
  FloorMemory floor({});
  Route route({});
  Eigen::Vector2d here_m(0.0, 0.1);
  const Eigen::Vector2d goal_m(2.5, 0.1);
  const double least_m = drive(route, floor, {kAcross}, goal_m, here_m, 120);
  EXPECT_LT((goal_m - here_m).norm(), 0.06);
  // The preferred margin, minus half a cell diagonal at both ends.
  EXPECT_GT(least_m, kRadiusM + Route::Options{}.margin_m - 0.07);
}

TEST(Route, LeavesAPocketLongerThanTheScanRange) {
  FloorMemory floor({});
  Route route({});
  const std::vector<Wall> pocket{
      {{3.0, -1.0}, {3.0, 1.0}}, {{-0.5, 1.0}, {3.0, 1.0}}, {{-0.5, -1.0}, {3.0, -1.0}}};
  Eigen::Vector2d here_m(-1.5, 0.0);
  const Eigen::Vector2d goal_m(4.0, 0.2);
  drive(route, floor, pocket, goal_m, here_m, 500);
  EXPECT_LT((goal_m - here_m).norm(), 0.06);
}

TEST(Route, KeepsItsSideInFrontOfAWall) {
  FloorMemory floor({});
  Route route({});
  observe(floor, {kAcross}, {});
  const bool left = route.towards(floor, {0.0, 0.02}, {2.5, 0.0}, kRadiusM).via_m.y() > 0.0;
  // The other side is now shorter by about 10 cm.
  for (const double y_m : {-0.1, 0.1})
    EXPECT_EQ(route.towards(floor, {0.0, y_m}, {2.5, 0.0}, kRadiusM).via_m.y() > 0.0, left) << y_m;
}

TEST(Route, ReplansWhenItsPathIsBlocked) {
  FloorMemory floor({});
  Route route({});
  observe(floor, {kAcross}, {});
  const double side = route.towards(floor, {0.0, 0.02}, {2.5, 0.0}, kRadiusM).via_m.y() > 0.0 ? 1.0 : -1.0;
  const std::vector<Wall> longer{kAcross, {{1.0, side * 0.8}, {1.0, side * 2.2}}};
  observe(floor, longer, {0.0, side * 0.5, 0.0}, 3);
  EXPECT_LT(side * route.towards(floor, {0.0, side * 0.1}, {2.5, 0.0}, kRadiusM).via_m.y(), 0.0);
}

TEST(Route, ReportsUnreachableGoalInsideAnObstacle) {
  FloorMemory floor({});
  Route route({});
  const std::vector<Wall> box{{{2.0, -0.2}, {2.0, 0.2}},
                              {{2.0, 0.2}, {2.4, 0.2}},
                              {{2.4, 0.2}, {2.4, -0.2}},
                              {{2.4, -0.2}, {2.0, -0.2}}};
  Eigen::Vector2d here_m(0.0, 0.0);
  drive(route, floor, box, {2.2, 0.0}, here_m, 200);
  const Route::Leg leg = route.towards(floor, here_m, {2.2, 0.0}, kRadiusM);
  EXPECT_FALSE(leg.reaches);
  EXPECT_LT(leg.left_m, 0.1);
}

TEST(Route, PlansTowardsAGoalBeyondTheWindow) {
  FloorMemory floor({});
  Route route({});
  observe(floor, {kAcross}, {});
  const Route::Leg leg = route.towards(floor, {0.0, 0.0}, {50.0, 0.0}, kRadiusM);
  EXPECT_FALSE(leg.straight);
  EXPECT_TRUE(leg.reaches);
  EXPECT_GT(std::abs(leg.via_m.y()), 0.8 + kRadiusM);
}

TEST(Route, ReachesFarGoalAroundManyWalls) {
  FloorMemory::Options small;
  small.window_m = 5.0;
  FloorMemory floor(small);
  Route route({});
  std::vector<Wall> walls;
  for (int i = 0; i < 9; ++i) {
    const double x_m = 1.3 * (i + 1), aside_m = i % 2 == 0 ? 0.4 : -0.5;
    walls.push_back({{x_m, aside_m - 0.7}, {x_m, aside_m + 0.7}});
  }
  Eigen::Vector2d here_m(0.0, 0.0);
  const Eigen::Vector2d goal_m(13.0, 0.1);
  drive(route, floor, walls, goal_m, here_m, 600);
  EXPECT_LT((goal_m - here_m).norm(), 0.06);
}

TEST(Route, FindsPathAfterObstacleIsRemoved) {
  FloorMemory floor({});
  Route route({});
  const std::vector<Wall> cage{{{1.0, -1.0}, {1.0, 1.0}},
                               {{1.0, 1.0}, {2.4, 1.0}},
                               {{2.4, 1.0}, {2.4, -1.0}},
                               {{2.4, -1.0}, {1.0, -1.0}}};
  Eigen::Vector2d here_m(0.0, 0.0);
  const Eigen::Vector2d goal_m(1.7, 0.0);
  observe(floor, {cage[2]}, {1.7, 0.0, 0.0});
  drive(route, floor, cage, goal_m, here_m, 150);
  EXPECT_FALSE(route.towards(floor, here_m, goal_m, kRadiusM).reaches);
  // The wall that is removed is the one in front of the robot.
  const std::vector<Wall> open = here_m.x() > goal_m.x() ? std::vector<Wall>{cage[0], cage[1], cage[3]}
                                                         : std::vector<Wall>{cage[1], cage[2], cage[3]};
  drive(route, floor, open, goal_m, here_m, 150);
  EXPECT_LT((goal_m - here_m).norm(), 0.06);
}

TEST(Route, LeavesAPlaceTooNearToAnObstacle) {
  FloorMemory floor({});
  Route route({});
  observe(floor, {kAcross}, {});
  const Eigen::Vector2d squeezed_m(1.0 - kRadiusM - 0.03, 0.0);
  const Route::Leg leg = route.towards(floor, squeezed_m, {2.5, 0.0}, kRadiusM);
  EXPECT_FALSE(leg.straight);
  EXPECT_GT((leg.via_m - squeezed_m).norm(), 0.1);
  EXPECT_GT(toWall(0.5 * (leg.via_m + squeezed_m), kAcross), kRadiusM + 0.02);
}

}  // namespace
}  // namespace omnifleet::motion
