#include "motion/near_field.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace omnifleet::motion {
namespace {

constexpr double kBlindM = 0.42, kRadiusM = 0.10;
constexpr int kRays = 360;

/// Scan of a disc by a camera whose robot hides the floor up to `blind_m`. Only the part of the disc that
/// extends beyond is seen.
Scan scanOf(const Eigen::Vector2d& disc_m, double blind_m = kBlindM, RayLabel label = RayLabel::kObstacle) {
  Scan scan;
  scan.blind_m = blind_m;
  for (int i = 0; i < kRays; ++i) {
    const Eigen::Vector2d unit(std::cos(2.0 * M_PI * i / kRays), std::sin(2.0 * M_PI * i / kRays));
    const double along_m = unit.dot(disc_m), aside2 = disc_m.squaredNorm() - along_m * along_m;
    const bool hit = along_m > 0.0 && aside2 < kRadiusM * kRadiusM;
    const double range_m = along_m - std::sqrt(std::max(0.0, kRadiusM * kRadiusM - aside2));
    scan.range_m.push_back(static_cast<float>(hit ? std::max(range_m, blind_m) : 2.5));
    scan.sigma_m.push_back(0.003f);
    scan.label.push_back(hit ? label : RayLabel::kFloorEnd);
    scan.object.push_back(0);
  }
  return scan;
}

double nearest(const NearField& field) {
  double least_m = INFINITY;
  for (const Eigen::Vector2d& point_m : field.points_m()) least_m = std::min(least_m, point_m.norm());
  return least_m;
}

/// Drives straight on, in steps of 4 cm, past a disc that is 0.8 m ahead at first.
Eigen::Vector2d passed(NearField& field, double aside_m, double way_m, RayLabel label = RayLabel::kObstacle) {
  Eigen::Vector2d disc_m(0.8, aside_m);
  field.see(scanOf(disc_m, kBlindM, label));
  for (double gone_m = 0.0; gone_m < way_m - 1e-9; gone_m += 0.04) {
    field.moved({0.04, 0.0, 0.0});
    disc_m.x() -= 0.04;
    field.see(scanOf(disc_m, kBlindM, label));
  }
  return disc_m;
}

TEST(NearField, KeepsPointsOfObstacleHiddenByTheBody) {
  NearField field;
  const Eigen::Vector2d disc_m = passed(field, 0.30, 0.8);
  // Rays are 1° apart: 7 mm at 0.42 m.
  EXPECT_NEAR(nearest(field), disc_m.norm() - kRadiusM, 0.01);
  for (const Eigen::Vector2d& point_m : field.points_m())
    EXPECT_NEAR((point_m - disc_m).norm(), kRadiusM, 0.002)
        << "points at the edge of the visible floor must not be kept";
}

TEST(NearField, RotatesPointsWithTheRobot) {
  NearField field;
  const Eigen::Vector2d disc_m = passed(field, 0.30, 0.8);
  const Pose2 turn{0.02, 0.0, 0.7};
  field.moved(turn);
  const Eigen::Vector2d turned_m = turn.inverse() * disc_m;
  ASSERT_FALSE(field.points_m().empty());
  for (const Eigen::Vector2d& point_m : field.points_m())
    EXPECT_NEAR((point_m - turned_m).norm(), kRadiusM, 0.002);
}

TEST(NearField, DropsPointsThatAreVisibleAgain) {
  NearField field;
  passed(field, 0.30, 1.6);
  EXPECT_TRUE(field.points_m().empty());
}

TEST(NearField, DoesNotAccumulatePointsAtTheEdge) {
  NearField field;
  Eigen::Vector2d disc_m = passed(field, 0.30, 0.6);
  const std::size_t before = field.points_m().size();
  for (int i = 0; i < 200; ++i) {
    const double sway_m = i % 2 == 0 ? 0.003 : -0.003;
    field.moved({sway_m, 0.0, 0.0});
    disc_m.x() -= sway_m;
    field.see(scanOf(disc_m));
  }
  EXPECT_LT(field.points_m().size(), before + 10);
}

TEST(NearField, IgnoresRobots) {
  NearField field;
  passed(field, 0.30, 0.8, RayLabel::kRobot);
  EXPECT_TRUE(field.points_m().empty());
  const Eigen::Vector2d disc_m = passed(field, 0.30, 0.8);
  ASSERT_FALSE(field.points_m().empty());
  field.clear(disc_m, 0.15);  // the obstacle was classified as a robot later
  EXPECT_TRUE(field.points_m().empty());
}

TEST(NearField, KeepsNothingWithoutABlindZone) {
  NearField field;
  field.see(scanOf({0.8, 0.3}, 0.0));
  field.moved({0.5, 0.0, 0.0});
  field.see(scanOf({0.3, 0.3}, 0.0));
  EXPECT_TRUE(field.points_m().empty());
}

}  // namespace
}  // namespace omnifleet::motion
