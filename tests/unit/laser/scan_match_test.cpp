#include "laser/scan_match.h"

#include <gtest/gtest.h>

#include <cmath>

#include "geometry/pose2.h"
#include "tests/unit/laser/room.h"

namespace omnifleet::laser {
namespace {

constexpr double kSigma_m = 0.005;

dataset::LaserSensor sensor() {
  dataset::LaserSensor s;
  s.range_max_m = 8.0;
  s.range_sigma_m = kSigma_m;
  return s;
}

/// A room of 6 m × 4 m with a box, a cylinder and another, moving robot, seen from `pose`.
test::Room seenFrom(const Pose2& pose, const Eigen::Vector2d& other_m) {
  const Pose2 here = pose.inverse();
  const auto moved = [&](Polygon polygon) {
    for (Eigen::Vector2d& p : polygon) p = here * p;
    return polygon;
  };
  test::Room room;
  room.polygons.push_back(moved(test::box({0.4, 0.1}, {6.0, 4.0}, 0.0)));
  room.polygons.push_back(moved(test::box({1.2, 0.9}, {0.3, 0.2}, 0.4)));
  room.discs.push_back({here * Eigen::Vector2d(-0.8, -0.7), 0.13});
  room.discs.push_back({here * other_m, 0.15});
  return room;
}

Beams beamsOf(const test::Room& room, std::uint32_t seed) {
  Beams beams;
  beams.set(room.scan(720, kSigma_m, seed), sensor());
  return beams;
}

Motion wheelMotion(const Pose2& pose) {
  Motion motion;
  motion.valid = true;
  motion.previous_from_current = pose;
  motion.covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-5).asDiagonal();
  return motion;
}

/// The wheels are wrong by 5° and 2 cm, and another robot moves by 6 cm. The result is compared with the true
/// motion and its covariance: χ² with three degrees of freedom over 20 runs has a mean of 3 ± 0.55.
TEST(ScanMatcher, EstimatesTrueMotionDespiteWheelErrors) {
  const Pose2 truth{0.05, 0.004, 0.11};
  double chi2 = 0.0;
  for (std::uint32_t seed = 1; seed <= 20; ++seed) {
    ScanMatcher matcher;
    matcher.refine(beamsOf(seenFrom({}, {0.7, -0.4}), seed), {0, 0}, kSigma_m, {});
    const Motion motion = matcher.refine(beamsOf(seenFrom(truth, {0.76, -0.4}), 100 + seed), {0, 0}, kSigma_m,
                                         wheelMotion({0.07, 0.0, 0.02}));
    const Eigen::Vector3d off = (truth.inverse() * motion.previous_from_current).vector();
    EXPECT_LT(off.head<2>().norm(), 0.004) << seed;
    EXPECT_LT(std::abs(off.z()), 0.003) << seed;
    chi2 += off.dot(motion.covariance.inverse() * off) / 20.0;
  }
  EXPECT_LT(chi2, 5.0);
}

TEST(ScanMatcher, ChangesNothingWithoutPredecessorOrWheels) {
  ScanMatcher matcher;
  const Motion wheels = wheelMotion({0.05, 0.0, 0.1});
  const Beams scan = beamsOf(seenFrom({}, {0.7, -0.4}), 3);
  EXPECT_EQ(matcher.refine(scan, {0, 0}, kSigma_m, wheels).previous_from_current.theta_rad, 0.1);
  EXPECT_FALSE(matcher.refine(scan, {0, 0}, kSigma_m, Motion{}).valid);
  matcher.forget();
  EXPECT_EQ(matcher.refine(scan, {0, 0}, kSigma_m, wheels).previous_from_current.theta_rad, 0.1);
}

/// Between two endless walls the scan gives no information along the corridor: the wheels determine it, with
/// a large σ.
TEST(ScanMatcher, UsesWheelsAlongACorridor) {
  test::Room corridor;
  corridor.polygons.push_back(test::box({0, 0}, {100.0, 1.6}, 0.0));
  ScanMatcher matcher;
  matcher.refine(beamsOf(corridor, 1), {0, 0}, kSigma_m, {});
  const Motion motion =
      matcher.refine(beamsOf(corridor, 2), {0, 0}, kSigma_m, wheelMotion({0.04, 0.0, 0.05}));
  EXPECT_NEAR(motion.previous_from_current.x_m, 0.04, 0.01);
  EXPECT_NEAR(motion.previous_from_current.theta_rad, 0.0, 0.003);
  EXPECT_GT(motion.covariance(0, 0), 10.0 * motion.covariance(1, 1));
}

}  // namespace
}  // namespace omnifleet::laser
