// Poses recovered from exact scans of polygons with known noise.
#include "scan/scan_matcher.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cmath>

#include "room_scans.h"

namespace omnifleet::scan {
namespace {

constexpr double kSigma = 0.003;                                             // 1/m
const Eigen::Matrix3d kLoose = Eigen::Vector3d(1e2, 1e2, 1e2).asDiagonal();  // prior: 0.1 m, 0.1 rad

struct Pair {
  LineScan reference, scan;
  Pose2 truth;
};

Pair pairOf(const testing::Scene& scene, const Pose2& at, const Pose2& moved, std::mt19937& random) {
  Pair pair;
  pair.reference.fit(scene.scan(at, kSigma, random));
  pair.truth = at * moved;
  pair.scan.fit(scene.scan(pair.truth, kSigma, random));
  return pair;
}

TEST(ScanMatcher, RecoversThePoseFromAWrongStart) {
  const testing::Scene room = testing::furnishedRoom();
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    const Pose2 at{-0.2, 0.1, 0.4};
    const Pair pair = pairOf(room, at, {0.20, -0.10, 0.15}, random);
    ScanMatcher matcher;
    const Match match =
        matcher.match(pair.scan, pair.truth * Pose2{0.05, -0.04, 0.04}, kLoose, {{&pair.reference, at}});
    ASSERT_TRUE(match.valid) << seed;
    // 0.003/m at 2 m is 12 mm per beam; some 300 beams leave about a millimetre.
    EXPECT_LT((match.map_from_scan.translation() - pair.truth.translation()).norm(), 0.004) << seed;
    EXPECT_LT(std::abs(wrapAngle(match.map_from_scan.theta_rad - pair.truth.theta_rad)), 0.003) << seed;
    EXPECT_GT(match.matched, 0.8) << seed;
  }
}

TEST(ScanMatcher, MatchesNothingWithAnEmptyReference) {
  std::mt19937 random(1);
  const LineScan empty;
  LineScan scan;
  scan.fit(testing::furnishedRoom().scan({}, kSigma, random));
  EXPECT_FALSE(ScanMatcher().match(scan, {}, kLoose, {{&empty, {}}}).valid);
}

TEST(ScanMatcher, InformationMatchesTheErrors) {
  const testing::Scene room = testing::furnishedRoom();
  double sum = 0.0;
  constexpr int kRuns = 200;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    std::mt19937 random(seed);
    const Pose2 at{0.1, 0.2, 0.0};
    const Pair pair = pairOf(room, at, {0.15, 0.05, 0.1}, random);
    ScanMatcher matcher;
    const Match match = matcher.match(pair.scan, pair.truth, 1e-3 * kLoose, {{&pair.reference, at}});
    ASSERT_TRUE(match.valid);
    const Pose2 off = pair.truth.inverse() * match.map_from_scan;
    const Eigen::Vector3d e(off.x_m, off.y_m, wrapAngle(off.theta_rad));
    sum += e.dot(match.information * e);
  }
  // Every second beam is used and lines of the reference share beams: between 3 (independent) and twice that.
  EXPECT_GT(sum / kRuns, 1.5);
  EXPECT_LT(sum / kRuns, 7.0);
}

TEST(ScanMatcher, LeavesTheLengthOfACorridorToThePrior) {
  std::mt19937 random(1);
  const Pair pair = pairOf(testing::corridor(), {0.0, 0.0, 0.0}, {0.1, 0.05, 0.02}, random);
  ScanMatcher matcher;
  const Pose2 start = pair.truth * Pose2{0.08, 0.03, 0.03};
  const Match match = matcher.match(pair.scan, start, kLoose, {{&pair.reference, Pose2{}}});
  ASSERT_TRUE(match.valid);
  EXPECT_NEAR(match.map_from_scan.y_m, pair.truth.y_m, 0.004);
  EXPECT_NEAR(match.map_from_scan.theta_rad, pair.truth.theta_rad, 0.003);
  EXPECT_NEAR(match.map_from_scan.x_m, start.x_m, 0.02) << "the prior decides";
  const Eigen::Matrix2d position = match.information.topLeftCorner<2, 2>();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(position);
  EXPECT_LT(solver.eigenvalues()(0), 1e-3 * solver.eigenvalues()(1));
}

/// A corridor with posts at both walls, each of which stands off its place along the corridor by σ `moved_m`.
testing::Scene corridorWithPosts(double moved_m, std::mt19937& random) {
  std::normal_distribution<double> normal(0.0, moved_m);
  testing::Scene scene = testing::corridor();
  for (int k = -4; k <= 4; ++k) {
    if (k == 0) continue;
    for (const double side : {-0.65, 0.65}) {
      const double x = 0.8 * k + (moved_m > 0 ? normal(random) : 0.0), half = 0.15;
      scene.outlines.push_back({{x - half, side - half},
                                {x + half, side - half},
                                {x + half, side + half},
                                {x - half, side + half}});
    }
  }
  return scene;
}

/// Doors that were moved contradict each other along the corridor, the walls agree: how well a pose is known
/// differs between the directions.
TEST(ScanMatcher, InformationOfEachDirectionMatchesItsErrors) {
  constexpr int kRuns = 60;
  constexpr double kMoved_m = 0.006;  // 1 to 2 σ of a beam
  double along = 0.0, across = 0.0, claimed = 0.0;
  for (unsigned seed = 0; seed < kRuns; ++seed) {
    std::mt19937 random(seed);
    const Pose2 truth{0.1, 0.05, 0.0};
    LineScan reference, scan;
    reference.fit(corridorWithPosts(0.0, random).scan({}, kSigma, random));
    scan.fit(corridorWithPosts(kMoved_m, random).scan(truth, kSigma, random));
    ScanMatcher matcher;
    const Match match = matcher.match(scan, truth, 1e-3 * kLoose, {{&reference, Pose2{}}});
    ASSERT_TRUE(match.valid);
    const Eigen::Matrix3d covariance = match.information.inverse();
    const Pose2 off = truth.inverse() * match.map_from_scan;
    along += off.x_m * off.x_m / covariance(0, 0) / kRuns;
    across += off.y_m * off.y_m / covariance(1, 1) / kRuns;
    claimed += covariance(0, 0) / covariance(1, 1) / kRuns;
  }
  EXPECT_NEAR(across, 1.0, 0.5);
  // Four posts nearby dominate, and a variance estimated from four errors is uncertain: σ is a third of the
  // errors.
  EXPECT_LT(along, 14.0);
  // Posts at their places: 4. One scatter for all directions would leave it there.
  EXPECT_GT(claimed, 40.0);
}

TEST(ScanMatcher, ToleratesThatFortyPercentOfTheBeamsAreBlocked) {
  const testing::Scene room = testing::furnishedRoom();
  std::mt19937 random(7);
  const Pose2 at{0.0, 0.0, 0.0}, truth = at * Pose2{0.2, 0.0, 0.1};
  LineScan reference, scan;
  reference.fit(room.scan(at, kSigma, random));
  Boundary blocked = room.scan(truth, kSigma, random);
  for (std::size_t i = 0; i < blocked.inverse_m.size(); ++i)  // legs at 0.6 to 0.8 m around the robot
    if (i % 100 < 40) blocked.inverse_m[i] = 1.4f + 0.2f * std::sin(0.3f * static_cast<float>(i));
  scan.fit(blocked);
  ScanMatcher matcher;
  const Match match = matcher.match(scan, truth * Pose2{0.03, 0.02, 0.02}, kLoose, {{&reference, at}});
  ASSERT_TRUE(match.valid);
  EXPECT_LT((match.map_from_scan.translation() - truth.translation()).norm(), 0.006);
}

TEST(ScanMatcher, RefusesAScanWithoutCommonLines) {
  std::mt19937 random(1);
  LineScan reference, scan;
  reference.fit(testing::furnishedRoom().scan({0.0, 0.0, 0.0}, kSigma, random));
  const testing::Scene elsewhere{{{{-0.5, -0.4}, {0.5, -0.4}, {0.5, 0.4}, {-0.5, 0.4}}}};
  scan.fit(elsewhere.scan({0.0, 0.0, 0.0}, kSigma, random));
  ScanMatcher matcher;
  EXPECT_FALSE(matcher.match(scan, {}, kLoose, {{&reference, Pose2{}}}).valid);
  EXPECT_FALSE(matcher.match(scan, {}, kLoose, {}).valid) << "no reference";
}

/// Keeps `count` beams of a scan, from bearing `from` on.
Boundary windowOf(Boundary boundary, std::size_t from, std::size_t count) {
  const std::size_t n = boundary.inverse_m.size();
  for (std::size_t i = count; i < n; ++i)
    boundary.inverse_m[(from + i) % n] = boundary.sigma[(from + i) % n] = 0.0f;
  return boundary;
}

TEST(ScanMatcher, UsesAllBeamsOfAScanWithFewLines) {
  const testing::Scene room = testing::furnishedRoom();
  const Pose2 at{-0.2, 0.1, 0.0}, truth = at * Pose2{0.12, -0.06, 0.1};
  for (unsigned seed = 0; seed < 20; ++seed) {
    std::mt19937 random(seed);
    LineScan reference, scan;
    reference.fit(room.scan(at, kSigma, random, 360));
    // 90° about the corner at (−2.5, −2).
    scan.fit(windowOf(room.scan(truth, kSigma, random, 360), 170, 90));
    ASSERT_NEAR(static_cast<double>(scan.lines()), 80.0, 10.0);
    ScanMatcher matcher;
    const Match match = matcher.match(scan, truth * Pose2{0.03, 0.02, -0.02}, kLoose, {{&reference, at}});
    ASSERT_TRUE(match.valid) << seed;
    EXPECT_GT(match.beams, static_cast<int>(scan.lines()) / 2 + 5) << "every second beam would be half";
    // Some 75 beams of 18 mm each at 2.5 m leave 2 mm per axis; walls at an angle leave more.
    EXPECT_LT((match.map_from_scan.translation() - truth.translation()).norm(), 0.02) << seed;
    EXPECT_LT(std::abs(wrapAngle(match.map_from_scan.theta_rad - truth.theta_rad)), 0.01) << seed;
  }
}

TEST(ScanMatcher, MatchesAScanWithLessThanTwiceTheLeastBeams) {
  const testing::Scene room = testing::furnishedRoom();
  std::mt19937 random(3);
  const Pose2 at{-0.2, 0.1, 0.0}, truth = at * Pose2{0.05, -0.03, 0.05};
  LineScan reference, scan;
  reference.fit(room.scan(at, kSigma, random, 360));
  scan.fit(windowOf(room.scan(truth, kSigma, random, 360), 188, 54));
  const MatchOptions options;
  ASSERT_LT(static_cast<int>(scan.lines()), 2 * options.min_beams);
  ASSERT_GT(static_cast<int>(scan.lines()), options.min_beams + 5);
  ScanMatcher matcher(options);
  const Match match = matcher.match(scan, truth * Pose2{0.02, 0.01, -0.01}, kLoose, {{&reference, at}});
  ASSERT_TRUE(match.valid) << "every second beam would be too few";
  EXPECT_LT((match.map_from_scan.translation() - truth.translation()).norm(), 0.03);
}

TEST(ScanMatcher, UsesEverySecondBeamOfAScanWithManyLines) {
  std::mt19937 random(3);
  const Pair pair = pairOf(testing::furnishedRoom(), {}, {0.05, 0.02, 0.02}, random);
  ASSERT_GT(pair.scan.lines(), 400U);
  ScanMatcher matcher;
  const Match match = matcher.match(pair.scan, pair.truth, kLoose, {{&pair.reference, Pose2{}}});
  ASSERT_TRUE(match.valid);
  EXPECT_LT(match.beams, static_cast<int>(pair.scan.lines()) * 6 / 10);
  EXPECT_GT(match.beams, static_cast<int>(pair.scan.lines()) * 4 / 10);
}

}  // namespace
}  // namespace omnifleet::scan
