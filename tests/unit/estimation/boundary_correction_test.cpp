// Boundaries of a room by a camera with known calibration errors.
#include "estimation/boundary_correction.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "observation/camera_error.h"
#include "tests/unit/scan/distorted_scans.h"

namespace omnifleet::estimation {
namespace {

using scan::testing::seenBy;
using scan::testing::WrongCamera;

constexpr double kStatedSigma = 0.003;  // 1/m
const Pose2 kScanner{0.3, -0.2, 0.35};

scan::testing::Scene wallsAround() {
  return {{{{-1.6, -1.2}, {1.6, -1.2}, {1.6, 1.2}, {-1.6, 1.2}}}};
}

/// Largest difference of the inverse range from that of a camera without error, of the boundary as seen and
/// as corrected. Three beams beside each corner are left out: there the boundary has no slope.
struct Remainder {
  double seen = 0.0, corrected = 0.0;
};

Remainder remainder(const WrongCamera& camera) {
  const Boundary seen = seenBy(camera, wallsAround(), kScanner, kStatedSigma),
                 exact = seenBy({}, wallsAround(), kScanner, kStatedSigma);
  Boundary corrected;
  correctBoundary(seen, camera.error, camera.height_m, camera.lens, corrected);
  Remainder most;
  const std::size_t n = seen.inverse_m.size();
  for (std::size_t i = 0; i < n; ++i) {
    bool corner = false;
    for (std::size_t d = n - 3; d <= n + 3; ++d) {
      const auto at = [&](std::size_t k) { return static_cast<double>(exact.inverse_m[k % n]); };
      const double second = at(i + d - 1) - 2.0 * at(i + d) + at(i + d + 1);
      corner = corner || std::abs(second) > 0.002;  // along a wall below 1e-4
    }
    if (corner) continue;
    const auto off = [&](const Boundary& b) {
      return std::abs(static_cast<double>(b.inverse_m[i]) - static_cast<double>(exact.inverse_m[i]));
    };
    most.seen = std::max(most.seen, off(seen));
    most.corrected = std::max(most.corrected, off(corrected));
  }
  return most;
}

TEST(BoundaryCorrection, LeavesASecondOrderRemainder) {
  for (const double kappa : {0.0, 0.25, -0.5}) {
    for (int k = 0; k < 4; ++k) {
      WrongCamera camera;
      camera.lens = lens::Spread(kappa);
      camera.error(k) = 0.002;
      const Remainder small = remainder(camera);
      camera.error(k) = 0.004;
      const Remainder large = remainder(camera);
      EXPECT_LT(small.corrected, 0.05 * small.seen) << "error " << k << ", κ " << kappa;
      // Twice the error leaves four times the remainder; values of type float leave 1e-6/m.
      EXPECT_LT(large.corrected, 5.0 * small.corrected + 2e-6) << "error " << k << ", κ " << kappa;
      EXPECT_GT(large.corrected, 3.0 * small.corrected - 2e-6) << "error " << k << ", κ " << kappa;
    }
  }
}

TEST(BoundaryCorrection, CorrectsAllErrorsTogether) {
  WrongCamera camera;
  camera.error << 0.003, -0.005, 0.002, -0.003;
  const Remainder both = remainder(camera);
  EXPECT_GT(both.seen, 4.0 * kStatedSigma) << "the error is visible";
  EXPECT_LT(both.corrected, 0.1 * both.seen);
  camera.error = -camera.error;
  const Remainder opposite = remainder(camera);
  EXPECT_LT(opposite.corrected, 0.1 * opposite.seen);
}

TEST(BoundaryCorrection, ScalesTheBoundaryByTheHeight) {
  // A height that is 1 % too large makes all ranges 1 % too large: closed form.
  const Boundary exact = seenBy({}, wallsAround(), kScanner, kStatedSigma);
  Boundary corrected;
  correctBoundary(exact, {0.0, 0.01, 0.0, 0.0}, 0.5, lens::Spread(), corrected);
  for (std::size_t i = 0; i < exact.inverse_m.size(); ++i)
    EXPECT_NEAR(corrected.inverse_m[i], exact.inverse_m[i] / 0.99f, 1e-6f) << i;
}

TEST(BoundaryCorrection, LeavesLasersAndZeroErrorsUnchanged) {
  Boundary seen = seenBy({}, wallsAround(), kScanner, kStatedSigma);
  seen.origin_m = {0.1, 0.2};
  seen.moving.assign(seen.inverse_m.size(), 0);
  seen.moving[5] = 1;
  const auto expectEqual = [&](const Boundary& corrected) {
    EXPECT_EQ(corrected.inverse_m, seen.inverse_m);
    EXPECT_EQ(corrected.sigma, seen.sigma);
    EXPECT_EQ(corrected.moving, seen.moving);
    EXPECT_EQ(corrected.origin_m, seen.origin_m);
  };
  Boundary corrected;
  correctBoundary(seen, {0.01, 0.01, 0.01, 0.01}, 0.0, lens::Spread(), corrected);
  expectEqual(corrected);
  correctBoundary(seen, Eigen::Vector4d::Zero(), 0.5, lens::Spread(), corrected);
  expectEqual(corrected);
}

TEST(BoundaryCorrection, KeepsBearingsWithoutMeasurement) {
  WrongCamera camera;
  camera.error << 0.003, 0.002, 0.004, -0.003;
  const Boundary whole = seenBy(camera, wallsAround(), kScanner, kStatedSigma);
  Boundary seen = whole;
  for (const std::size_t i : {0U, 100U, 101U, 719U}) seen.inverse_m[i] = seen.sigma[i] = 0.0f;
  Boundary corrected, corrected_whole;
  correctBoundary(seen, camera.error, camera.height_m, camera.lens, corrected);
  correctBoundary(whole, camera.error, camera.height_m, camera.lens, corrected_whole);
  for (const std::size_t i : {0U, 100U, 101U, 719U}) EXPECT_EQ(corrected.inverse_m[i], 0.0f) << i;
  // Neighbours of a gap are corrected along their bearing only: a slope below 1/m per rad, 6 mrad.
  for (const std::size_t i : {1U, 99U, 102U, 718U})
    EXPECT_NEAR(corrected.inverse_m[i], corrected_whole.inverse_m[i], 0.006f) << i;
  EXPECT_EQ(corrected.inverse_m[50], corrected_whole.inverse_m[50]);
}

TEST(BeamFields, EqualTheCameraFieldAtEachLine) {
  WrongCamera camera;
  camera.lens = lens::Spread(0.25);
  scan::LineScan scan;
  scan.fit(seenBy(camera, scan::testing::furnishedRoom(), kScanner, kStatedSigma));
  const scan::BeamFields fields = beamFields(scan, camera.height_m, camera.lens);
  ASSERT_EQ(fields.size(), scan.beams().size());
  int lines = 0;
  for (std::size_t i = 0; i < fields.size(); ++i) {
    const scan::LineScan::Beam& beam = scan.beams()[i];
    if (!beam.has_line) {
      EXPECT_EQ(fields[i].norm(), 0.0f) << i;
      continue;
    }
    ++lines;
    const Eigen::Matrix<float, 2, 4> expected =
        cameraField(beam.point_m.cast<double>(), camera.height_m, camera.lens).cast<float>();
    EXPECT_TRUE(fields[i].isApprox(expected, 1e-6f)) << i;
  }
  EXPECT_GT(lines, 400);
}

TEST(BeamFields, AreEmptyForLasers) {
  scan::LineScan scan;
  scan.fit(seenBy({}, wallsAround(), kScanner, kStatedSigma));
  EXPECT_TRUE(beamFields(scan, 0.0, lens::Spread()).empty());
}

}  // namespace
}  // namespace omnifleet::estimation
