#include "ground/far_floor.h"

#include <algorithm>
#include <cmath>
#include <optional>

namespace omnifleet::ground {

namespace {

// Far away, a gradient that is constant over the floor grows in proportion to the floor length per block. The
// gradient of light that falls as a power of the distance grows with the square root of that length. The root
// is used; region growing adapts to the difference.
constexpr double kPower = 0.5;
constexpr double kMostSteepening = 4.0;
constexpr double kOutward = 0.3;  // minimum share of the largest increase in distance for an outward step

}  // namespace

FarFloor::FarFloor(const lens::Camera& camera, cv::Size blocks, int block_px)
    : blocks_(static_cast<std::size_t>(blocks.area())) {
  const auto distanceAt = [&](int x, int y) -> std::optional<double> {
    const auto point =
        camera.floorFromPixel(Eigen::Vector2d(x + 0.5, y + 0.5) * block_px - Eigen::Vector2d(0.5, 0.5));
    if (!point) return std::nullopt;
    return (*point - camera.foot()).norm();
  };
  for (int y = 0; y < blocks.height; ++y) {
    for (int x = 0; x < blocks.width; ++x) {
      const auto here = distanceAt(x, y);
      if (!here) continue;
      double rises[kSteps], most = 0.0, steepening = 1.0;
      for (int k = 0; k < kSteps; ++k) {
        const double length = std::hypot(kStepX[k], kStepY[k]);
        const auto next = distanceAt(x + kStepX[k], y + kStepY[k]),
                   after = distanceAt(x + 2 * kStepX[k], y + 2 * kStepY[k]);
        rises[k] = next ? (*next - *here) / length : 0.0;
        if (rises[k] <= most) continue;
        most = rises[k];
        steepening = after ? std::pow(std::max(0.0, *after - *next) / (*next - *here), kPower) : 1.0;
      }
      Block& block = blocks_[static_cast<std::size_t>(y * blocks.width + x)];
      block.steepening = static_cast<float>(std::clamp(steepening, 1.0, kMostSteepening));
      for (int k = 0; k < kSteps; ++k)
        if (rises[k] > kOutward * most) block.outward |= static_cast<std::uint8_t>(1u << k);
    }
  }
}

}  // namespace omnifleet::ground
