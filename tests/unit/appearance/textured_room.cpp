#include "tests/unit/appearance/textured_room.h"

#include <algorithm>
#include <cmath>
#include <random>

namespace omnifleet::test {
namespace {

constexpr double kCameraHeight_m = 0.5, kDegree = M_PI / 180.0, kFloorGrey = 150.0;
constexpr int kRays = 2;  // per cell and axis

}  // namespace

TexturedRoom::TexturedRoom(unsigned seed, Eigen::Vector2d half_m) : half_m_(std::move(half_m)) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> unit(0.0, 1.0);
  for (std::size_t wall = 0; wall < waves_.size(); ++wall) {
    base_[wall] = 70.0 + 110.0 * unit(random);
    for (int k = 0; k < 8; ++k) {
      // Patterns of 0.15 m to 2 m.
      const double length_m = 0.15 * std::pow(2.0 / 0.15, unit(random));
      waves_[wall].push_back(
          {2.0 * M_PI / length_m, 2.0 * M_PI * unit(random), 2.0 * M_PI * unit(random), 15.0});
    }
  }
}

double TexturedRoom::grey(const Pose2& map_from_base, double camera_height_m, double bearing_rad,
                          double elevation_rad) const {
  const double heading = map_from_base.theta_rad + bearing_rad;
  const Eigen::Vector2d at = map_from_base.translation(), along(std::cos(heading), std::sin(heading));
  double range = 1e9, position = 0.0;
  std::size_t wall = 0;
  for (int axis = 0; axis < 2; ++axis) {
    if (std::abs(along[axis]) < 1e-12) continue;
    const bool positive = along[axis] > 0.0;
    const double distance = ((positive ? half_m_[axis] : -half_m_[axis]) - at[axis]) / along[axis];
    if (distance >= range) continue;
    range = distance;
    wall = static_cast<std::size_t>(2 * axis + (positive ? 1 : 0));
    position = at[1 - axis] + distance * along[1 - axis];
  }
  const double height = camera_height_m + range * std::tan(elevation_rad);
  if (height < 0.0) return kFloorGrey;
  double grey = base_[wall];
  for (const Wave& w : waves_[wall])
    grey += w.amplitude * std::sin(w.along * position + w.phase) * std::cos(w.up * height);
  return std::clamp(grey, 0.0, 255.0);
}

cv::Mat1b TexturedRoom::panorama(const Pose2& map_from_base,
                                 const appearance::PanoramaOptions& options) const {
  cv::Mat1b panorama(options.rows, options.columns);
  const double row_rad = (options.most_elevation_deg - options.least_elevation_deg) * kDegree / options.rows,
               column_rad = 2.0 * M_PI / options.columns;
  for (int row = 0; row < panorama.rows; ++row) {
    for (int column = 0; column < panorama.cols; ++column) {
      double sum = 0.0;
      for (int k = 0; k < kRays * kRays; ++k) {
        const double u = column + (k % kRays - 0.5) / kRays, v = row + (k / kRays + 0.5) / kRays;
        sum += grey(map_from_base, kCameraHeight_m, u * column_rad,
                    options.most_elevation_deg * kDegree - v * row_rad);
      }
      panorama(row, column) = static_cast<std::uint8_t>(std::lround(sum / (kRays * kRays)));
    }
  }
  return panorama;
}

appearance::Unwrapper roomUnwrapper(const appearance::PanoramaOptions& options) {
  return appearance::Unwrapper::fromEquirectangular({1024, 512}, options);
}

}  // namespace omnifleet::test
