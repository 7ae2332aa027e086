#include "synthetic/laser_scanner.h"

#include <gtest/gtest.h>

#include <cmath>

namespace omnifleet::synthetic {
namespace {

/// A room of 4 m × 3 m with walls, a cylinder, a box lower than the scanner, and another robot.
Arena arena(const std::string& laser) {
  return Arena::read(options::Section::parse(R"(
name: scanned
floor: {size_m: [4, 3]}
obstacles:
  - {kind: cylinder, pose: [1.0, 0.0, 0], radius_m: 0.2, height_m: 0.3}
  - {kind: box, pose: [0.0, 1.0, 0], size_m: [0.4, 0.4], height_m: 0.05}
walls: {height_m: 0.3}
robots: {r1: {initial_pose: [0, 0, 0]}, r2: {initial_pose: [-1, 0, 0]}}
rigs: {laser: {)" + laser + "}}\n",
                                             "scanned.yaml"));
}

const std::vector<Pose2> kPoses{{0.0, 0.0, 0.0}, {-1.0, 0.0, 0.0}};

/// Closed form of the range to the walls, the cylinder (radius 0.2 at 1 m) and the other robot (radius 0.15
/// at −1 m).
double expected(double bearing) {
  const double c = std::cos(bearing), s = std::sin(bearing);
  const double wall = std::min(2.0 / std::abs(c), 1.5 / std::abs(s));
  for (const auto& [x, radius] : {std::pair{1.0, 0.2}, {-1.0, 0.15}}) {
    const double half = radius * radius - x * x * s * s;
    if (half > 0.0 && x * c > 0.0) return x * c - std::sqrt(half);
  }
  return wall;
}

TEST(LaserScanner, MatchesRangesInClosedForm) {
  LaserScanner scanner(arena("beams: 360, position_m: [0, 0, 0.1], range_max_m: 8, range_sigma_m: 0.0001"),
                       "r1", 3);
  const dataset::LaserRow& row = scanner.scan(0, kPoses);
  ASSERT_EQ(row.range_m.size(), 360u);
  EXPECT_NEAR(row.angle_increment_rad, M_PI / 180.0, 1e-12);
  int checked = 0;
  for (std::size_t i = 0; i < row.range_m.size(); ++i) {
    const double bearing = row.angle_min_rad + static_cast<double>(i) * row.angle_increment_rad;
    const double off_edge =
        std::min(std::abs(std::abs(std::sin(bearing)) - 0.2), std::abs(std::abs(std::sin(bearing)) - 0.15));
    if (off_edge < 0.01) continue;  // at a tangent the polygon of the mesh differs from the circle
    // Tolerance: one millimetre of rounding, the chords of the mesh, and 0.1 mm of noise.
    EXPECT_NEAR(row.range_m[i], expected(bearing), 2.5e-3) << bearing;
    ++checked;
  }
  EXPECT_GT(checked, 330);
}

/// A scanner at 10 cm does not see the low box, a scanner at 3 cm does. The robot itself is never seen.
TEST(LaserScanner, SeesOnlyObjectsThatReachItsHeight) {
  LaserScanner low(arena("beams: 360, position_m: [0, 0, 0.03], range_sigma_m: 0.0001"), "r1", 3);
  EXPECT_NEAR(low.scan(0, kPoses).range_m[270], 0.8, 2e-3);
}

TEST(LaserScanner, AppliesMountingAndMaximumRange) {
  LaserScanner scanner(arena("beams: 181, fov_deg: 180, position_m: [0.5, 0, 0.1], yaw_deg: 90, range_max_m: "
                             "1.2, range_sigma_m: 0.0001"),
                       "r1", 3);
  // The scanner is turned by 90° about the centre of the room. The former forward direction (+x) is now to
  // its right.
  const dataset::LaserRow& row = scanner.scan(0, kPoses);
  EXPECT_NEAR(row.range_m.front(), 0.3, 2e-3) << "the cylinder, seen from 0.5 m";
  EXPECT_TRUE(std::isinf(row.range_m[90])) << "the wall at 1.5 m is out of range";
  EXPECT_TRUE(std::isinf(row.range_m.back())) << "the other robot at 1.35 m is out of range, too";
}

TEST(LaserScanner, AddsReproducibleGaussianNoise) {
  const Arena a = arena("beams: 720, position_m: [0, 0, 0.1], range_sigma_m: 0.02");
  LaserScanner one(a, "r1", 5), other(a, "r1", 5), third(a, "r1", 6);
  LaserScanner exact(arena("beams: 720, position_m: [0, 0, 0.1], range_sigma_m: 0.0001"), "r1", 5);
  double squares = 0.0, sum = 0.0;
  int count = 0;
  for (int frame = 0; frame < 20; ++frame) {
    const dataset::LaserRow row = one.scan(frame, kPoses);
    const dataset::LaserRow& truth = exact.scan(frame, kPoses);
    for (std::size_t i = 0; i < row.range_m.size(); ++i, ++count) {
      const double off = row.range_m[i] - truth.range_m[i];
      sum += off;
      squares += off * off;
    }
  }
  // 14 400 deviates: σ of their mean is 0.00017, σ of their standard deviation 0.6 %.
  EXPECT_NEAR(sum / count, 0.0, 7e-4);
  EXPECT_NEAR(std::sqrt(squares / count), 0.02, 5e-4);
  EXPECT_EQ(one.scan(3, kPoses).range_m, other.scan(3, kPoses).range_m) << "independent of earlier scans";
  EXPECT_NE(one.scan(3, kPoses).range_m, third.scan(3, kPoses).range_m);
}

TEST(LaserScanner, RejectsUnknownRobotAndInvalidOptions) {
  EXPECT_THROW(LaserScanner(arena("beams: 360"), "r9", 1), options::Error);
  EXPECT_THROW(arena("beams: 4"), options::Error);
  EXPECT_THROW(arena("rays: 360"), options::Error) << "an unknown key was accepted";
}

}  // namespace
}  // namespace omnifleet::synthetic
