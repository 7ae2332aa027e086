// Lines fitted to exact scans of polygons: closed forms.
#include "scan/line_scan.h"

#include <gtest/gtest.h>

#include <cmath>
#include <functional>

#include "room_scans.h"

namespace omnifleet::scan {
namespace {

constexpr double kNoise = 0.003;  // 1/m: a quarter of a pixel of a camera of 640 × 480 at 0.5 m

TEST(LineScan, FindsTheWallsOfARoom) {
  std::mt19937 random(1);
  const testing::Scene square{{{{-2, -1.5}, {2, -1.5}, {2, 1.5}, {-2, 1.5}}}};
  LineScan scan;
  scan.fit(square.scan({0.3, 0.2, 0.0}, 0.0, random));
  int near = 0, right = 0;
  for (const LineScan::Beam& beam : scan.beams()) {
    if (!beam.has_line) continue;
    const Eigen::Vector2d normal = beam.line.cast<double>().normalized();
    const double distance = 1.0 / beam.line.cast<double>().norm();
    // Each beam's line is one of the four walls, seen from (0.3, 0.2).
    const double expected = normal.x() > 0.9 ? 1.7 : normal.x() < -0.9 ? 2.3 : normal.y() > 0.9 ? 1.3 : 1.7;
    near += std::abs(distance - expected) < 1e-3 ? 1 : 0;
    right += std::abs(std::max(std::abs(normal.x()), std::abs(normal.y())) - 1.0) < 1e-5 ? 1 : 0;
  }
  EXPECT_GT(scan.lines(), 680U);  // all but the corners
  EXPECT_EQ(near, static_cast<int>(scan.lines()));
  EXPECT_EQ(right, static_cast<int>(scan.lines()));
}

TEST(LineScan, HasTheMeanRangeAndTheNoiseOfItsRanges) {
  // A regular polygon of many sides around the scanner: all ranges are 2 m.
  Polygon round;
  for (int k = 0; k < 90; ++k) {
    const double angle = 2.0 * M_PI * k / 90;
    round.push_back({2.0 * std::cos(angle), 2.0 * std::sin(angle)});
  }
  std::mt19937 random(6);
  LineScan scan;
  scan.fit(testing::Scene{{round}}.scan({}, kNoise, random));
  EXPECT_NEAR(scan.meanRangeM(), 2.0, 0.005);
  EXPECT_NEAR(scan.medianSigmaM(), 4.0 * kNoise, 0.1 * 4.0 * kNoise);  // σ of r is r²·σ of 1/r
  Boundary nothing;
  nothing.inverse_m.assign(360, 0.0f);
  nothing.sigma.assign(360, 0.0f);
  scan.fit(nothing);
  EXPECT_EQ(scan.meanRangeM(), 0.0);
  EXPECT_EQ(scan.medianSigmaM(), 0.0);
}

TEST(LineScan, BearingErrorCountsWhereWallsAreSeenAtAnAngle) {
  // A wall at distance d, θ off its normal: s = cos θ / d, so an error of the bearing moves s by sin θ / d.
  constexpr double kBearing_rad = 0.01;
  std::mt19937 random(3);
  const testing::Scene square{{{{-2, -2}, {2, -2}, {2, 2}, {-2, 2}}}};
  Boundary boundary = square.scan({}, 0.0, random);
  boundary.sigma.assign(boundary.sigma.size(), static_cast<float>(kNoise));
  LineScan exact, scan;
  exact.fit(boundary);
  scan.fit(boundary, {}, kBearing_rad);
  ASSERT_EQ(scan.lines(), exact.lines());
  for (std::size_t i = 0; i < scan.beams().size(); ++i) {
    const LineScan::Beam &before = exact.beams()[i], &beam = scan.beams()[i];
    if (!beam.has_line) continue;
    const double bearing = 2.0 * M_PI * static_cast<double>(i) / static_cast<double>(scan.beams().size());
    const double theta = bearing - M_PI / 2.0 * std::round(bearing / (M_PI / 2.0));
    const double by_bearing = kBearing_rad * std::sin(theta) / 2.0,
                 expected = std::hypot(static_cast<double>(before.sigma), by_bearing);
    EXPECT_NEAR(beam.sigma, expected, 0.02 * expected) << i;
    const double wider = expected * expected / (static_cast<double>(before.sigma) * before.sigma);
    EXPECT_NEAR(beam.line_covariance.trace() / before.line_covariance.trace(), wider, 0.05 * wider) << i;
  }
}

TEST(LineScan, FindsNoLineInThreeBeams) {
  // Between two depth jumps few beams show a face: four have a line, three fit almost anything.
  for (const int beams : {3, 4, 5}) {
    std::mt19937 random(7);
    Boundary boundary = testing::Scene{{{{-2, -1.5}, {2, -1.5}, {2, 1.5}, {-2, 1.5}}}}.scan({}, 0.0, random);
    for (auto& sigma : boundary.sigma) sigma = static_cast<float>(kNoise);
    for (std::size_t i = 200; i < 220; ++i) boundary.inverse_m[i] = 0.0f;
    const testing::Scene post{{{{-0.9, 0.0}, {-0.85, 0.0}, {-0.85, 1.0}, {-0.9, 1.0}}}};
    const Boundary face = post.scan({}, 0.0, random);
    int shown = 0;
    for (std::size_t i = 290; shown < beams; ++i, ++shown) boundary.inverse_m[i] = face.inverse_m[i];
    for (std::size_t i = 285; i < 290; ++i) boundary.inverse_m[i] = boundary.inverse_m[i + 15] = 0.0f;
    LineScan scan;
    scan.fit(boundary);
    int lines = 0;
    for (std::size_t i = 290; i < 300; ++i)
      lines += scan.beams()[i].has_line && scan.beams()[i].s > 0.9f ? 1 : 0;
    EXPECT_EQ(lines > 0, beams >= 4) << beams;
  }
}

TEST(LineScan, LeavesOutDepthJumpsAndOutliers) {
  std::mt19937 random(2);
  const testing::Scene room = testing::furnishedRoom();
  Boundary boundary = room.scan({0.0, 0.0, 0.3}, kNoise, random);
  for (std::size_t i = 0; i < boundary.inverse_m.size(); i += 20) boundary.inverse_m[i] *= 1.5f;
  LineScan scan;
  scan.fit(boundary);
  for (std::size_t i = 0; i < boundary.inverse_m.size(); i += 20) EXPECT_FALSE(scan.beams()[i].has_line) << i;
  EXPECT_GT(scan.lines(), 400U);
}

TEST(LineScan, EstimatesNoiseThatIsLargerThanStated) {
  std::mt19937 random(3);
  Boundary boundary = testing::furnishedRoom().scan({0.0, 0.0, 0.0}, 2.0 * kNoise, random);
  for (float& sigma : boundary.sigma) sigma = static_cast<float>(kNoise);
  LineScan scan;
  scan.fit(boundary);
  EXPECT_NEAR(scan.noiseScale(), 2.0, 0.2);  // median of 700 values: 5 %
}

TEST(LineScan, CovarianceOfLinesMatchesTheirErrors) {
  std::mt19937 random(4);
  const testing::Scene square{{{{-2, -1.5}, {2, -1.5}, {2, 1.5}, {-2, 1.5}}}};
  double sum = 0.0;
  int n = 0;
  for (int k = 0; k < 300; ++k) {
    LineScan scan;
    scan.fit(square.scan({0.0, 0.0, 0.0}, kNoise, random));
    const LineScan::Beam& beam = scan.beams()[0];  // towards the wall at x = 2
    if (!beam.has_line) continue;
    const Eigen::Vector2d off = beam.line.cast<double>() - Eigen::Vector2d(0.5, 0.0);
    sum += off.dot(beam.line_covariance.cast<double>().inverse() * off);
    ++n;
  }
  EXPECT_GT(n, 280);
  EXPECT_NEAR(sum / n, 2.0, 0.5);  // χ² of two parameters; windows are chosen by their fit: a little less
}

TEST(LineScan, IgnoresBeamsThatMeasureNothingOrAreMasked) {
  std::mt19937 random(5);
  Boundary boundary = testing::furnishedRoom().scan({0.0, 0.0, 0.0}, kNoise, random);
  boundary.inverse_m[10] = std::nanf("");
  boundary.sigma[11] = 0.0f;
  std::vector<bool> usable(boundary.inverse_m.size(), true);
  usable[12] = false;
  LineScan scan;
  scan.fit(boundary, usable);
  for (const std::size_t i : {10U, 11U, 12U}) EXPECT_FALSE(scan.beams()[i].has_line) << i;
  boundary.inverse_m.resize(30);
  boundary.sigma.resize(30);
  scan.fit(boundary);
  EXPECT_EQ(scan.lines(), 0U) << "too few beams for a window";
}

/// A boundary that measures 2 m at some bearings and nothing at the others.
Boundary measuredAt(std::size_t beams, const std::function<bool(std::size_t)>& measures) {
  Boundary boundary;
  for (std::size_t i = 0; i < beams; ++i) {
    boundary.inverse_m.push_back(measures(i) ? 0.5f : 0.0f);
    boundary.sigma.push_back(measures(i) ? 0.003f : 0.0f);
  }
  return boundary;
}

TEST(LineScan, SectorsShowWhichBearingsMeasured) {
  LineScan scan;
  EXPECT_EQ(scan.sectors(), 0U);
  for (const std::size_t beams : {180U, 360U, 720U}) {
    const auto sectors = [&](const std::function<bool(std::size_t)>& measures) {
      scan.fit(measuredAt(beams, measures));
      return scan.sectors();
    };
    EXPECT_EQ(sectors([](std::size_t) { return true; }), ~std::uint64_t{0}) << beams;
    EXPECT_EQ(sectors([](std::size_t) { return false; }), 0U) << beams;
    const std::size_t half = beams / 2;
    EXPECT_EQ(sectors([&](std::size_t i) { return i < half; }), 0x00000000ffffffffULL) << beams;
    EXPECT_EQ(sectors([&](std::size_t i) { return i >= half; }), 0xffffffff00000000ULL) << beams;
    // A scanner that looks forward: sectors 0–15 on the left and 48–63 on the right.
    EXPECT_EQ(sectors([&](std::size_t i) { return i < half / 2 || i >= beams - half / 2; }),
              0xffff00000000ffffULL)
        << beams;
    EXPECT_EQ(sectors([&](std::size_t i) { return i == half; }), std::uint64_t{1} << 32) << beams;
  }
}

TEST(LineScan, SectorsLeaveOutMaskedBeams) {
  const Boundary boundary = measuredAt(720, [](std::size_t) { return true; });
  std::vector<bool> usable(720, true);
  for (std::size_t i = 0; i < 360; ++i) usable[i] = false;
  LineScan scan;
  scan.fit(boundary, usable);
  EXPECT_EQ(scan.sectors(), 0xffffffff00000000ULL);
  scan.compact();
  EXPECT_EQ(scan.sectors(), 0xffffffff00000000ULL) << "kept scans have them, too";
}

}  // namespace
}  // namespace omnifleet::scan
