#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>

#include "observation/camera_error.h"
#include "tests/unit/scan/room_scans.h"

namespace omnifleet::scan::testing {

/// A camera whose calibration is wrong by `error` (focal length, height, roll, pitch).
struct WrongCamera {
  double height_m = 0.5;
  lens::Spread lens;  ///< equidistant
  Eigen::Vector4d error = Eigen::Vector4d::Zero();
};

/// Boundary that this camera reports without noise: it sees each point p of the scene at p + field(p)·error.
/// Bearings without exactly one such point (depth jumps) give nothing. @param sigma 1/m, stated
inline Boundary seenBy(const WrongCamera& camera, const Scene& scene, const Pose2& pose, double sigma,
                       int beams = 720) {
  Boundary boundary;
  for (int i = 0; i < beams; ++i) {
    const double bearing = 2.0 * M_PI * i / beams;
    double from = bearing, off = 1.0;  // bearing of the true point, and what is left of the difference
    Eigen::Vector2d seen(0.0, 0.0);
    for (int round = 0; round < 30 && std::abs(off) > 1e-12; ++round) {
      const double turned = pose.theta_rad + from;
      const double range_m = scene.range(pose.translation(), {std::cos(turned), std::sin(turned)});
      const Eigen::Vector2d p = range_m * Eigen::Vector2d(std::cos(from), std::sin(from));
      seen = p + cameraField(p, camera.height_m, camera.lens) * camera.error;
      off = wrapAngle(bearing - std::atan2(seen.y(), seen.x()));
      from += off;
    }
    const bool found = std::abs(off) < 1e-9 && seen.norm() > 0.0;
    boundary.inverse_m.push_back(found ? static_cast<float>(1.0 / seen.norm()) : 0.0f);
    boundary.sigma.push_back(found ? static_cast<float>(sigma) : 0.0f);
  }
  return boundary;
}

/// Adds Gaussian noise of the stated σ to each beam.
inline void addNoise(Boundary& boundary, std::mt19937& random) {
  std::normal_distribution<float> noise(0.0f, 1.0f);
  for (std::size_t i = 0; i < boundary.inverse_m.size(); ++i)
    boundary.inverse_m[i] += boundary.sigma[i] * noise(random);
}

}  // namespace omnifleet::scan::testing
