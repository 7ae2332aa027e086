#pragma once

// Analytic views of prisms for the tests. The silhouette is the hull of the floor polygon and of the top
// polygon, scaled about the camera's foot by H/(H − h). Every direction has noise of 0.4 px of a 960 px
// equidistant lens.

#include <algorithm>
#include <cmath>
#include <random>
#include <vector>

#include "outline/prism.h"

namespace omnifleet::testing {

struct Prism {
  Polygon footprint_m;
  double height_m;
};

inline Polygon box(const Eigen::Vector2d& centre, double length_m, double width_m, double turn_rad) {
  const Eigen::Rotation2Dd turn(turn_rad);
  Polygon corners;
  for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
    corners.push_back(centre + turn * Eigen::Vector2d(0.5 * x * length_m, 0.5 * y * width_m));
  }
  return corners;
}

/// σ of a floor point at a distance from the foot, along the ray: 0.4 px and 1 mm.
inline double floorSigma(double distance_m, double camera_height_m) {
  constexpr double kFocalPx = 305.0;
  return 0.4 * (camera_height_m * camera_height_m + distance_m * distance_m) / (camera_height_m * kFocalPx) +
         0.001;
}

inline outline::PrismView viewOf(const Prism& prism, const Pose2& map_from_base, double camera_height_m,
                                 std::mt19937& random, double noise = 1.0) {
  outline::PrismView view;
  view.map_from_base = map_from_base;
  view.foot_m = {0.02, -0.01};
  view.camera_height_m = camera_height_m;
  view.supports = outline::prismSupports(prism.footprint_m, prism.height_m, view, 1.0);
  const double distance = (centroid(prism.footprint_m) - map_from_base * view.foot_m).norm();
  const double scale = camera_height_m / (camera_height_m - prism.height_m);
  std::normal_distribution<double> normal;
  for (std::size_t k = 0; k < view.supports.size(); ++k) {
    const bool far_side = view.supports.b_m[k] > 0;
    const double sigma =
        std::max(noise, 0.1) * floorSigma(far_side ? distance * scale : distance, camera_height_m);
    view.supports.sigma_m[k] = static_cast<float>(sigma);
    view.supports.b_m[k] += static_cast<float>(noise > 0 ? sigma * normal(random) : 0.0);
  }
  return view;
}

/// `robots` robots around the prism at 0.7–1.5 m, each with `views_each` views while it passes.
inline std::vector<outline::PrismView> views(const Prism& prism, int robots, int views_each,
                                             std::mt19937& random, double noise = 1.0) {
  std::uniform_real_distribution<double> uniform(0.0, 1.0);
  std::vector<outline::PrismView> all;
  const double first = 2.0 * M_PI * uniform(random);
  for (int r = 0; r < robots; ++r) {
    const double direction = first + 2.0 * M_PI * (r + 0.3 * uniform(random)) / robots;
    const double distance = 0.7 + 0.8 * uniform(random), heading = 2.0 * M_PI * uniform(random);
    for (int v = 0; v < views_each; ++v) {
      const Eigen::Vector2d along(-std::sin(direction), std::cos(direction));
      const Eigen::Vector2d p = centroid(prism.footprint_m) +
                                distance * Eigen::Vector2d(std::cos(direction), std::sin(direction)) +
                                0.06 * v * along;
      all.push_back(viewOf(prism, {p.x(), p.y(), heading + 0.1 * v}, 0.5, random, noise));
    }
  }
  return all;
}

}  // namespace omnifleet::testing
