#pragma once

// A floor under one lamp, for the tests of `ground`.

#include <cmath>
#include <opencv2/core.hpp>
#include <random>

#include "lens/camera.h"

namespace omnifleet::ground::testing {

struct Lamp {
  double height_m = 2.0, aside_m = 0.0;
  Eigen::Vector2d foot() const { return {aside_m, 0.0}; }
};

/// Ambient light as a share of the light beneath the lamp.
constexpr double kAmbient = 0.08;
/// Exponents of the camera's tone curve.
constexpr double kLinear = 1.0, kDisplay = 1.0 / 2.2;

/// Lambert's law: the cube of the cosine over the squared height, relative to the point beneath the lamp.
inline double lampLightAt(const Lamp& lamp, const Eigen::Vector2d& floor_m) {
  const double tangent = (floor_m - lamp.foot()).norm() / lamp.height_m;
  return std::pow(1.0 + tangent * tangent, -1.5);
}

/// A bare floor under a lamp, with 160 grey levels at the camera's foot.
inline cv::Mat3b floorUnder(const Lamp& lamp, const lens::Camera& camera, double curve) {
  const auto& model = camera.model();
  cv::Mat3b image(model.image_height_px, model.image_width_px, cv::Vec3b(60, 70, 80));
  std::mt19937 random(1);
  std::normal_distribution<double> gauss(0.0, 1.5);
  const double at_foot = lampLightAt(lamp, camera.foot());
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const auto point = camera.floorFromPixel(Eigen::Vector2d(u, v));
      if (!point) continue;
      const double light = std::pow((1.0 - kAmbient) * lampLightAt(lamp, *point) / at_foot + kAmbient, curve);
      for (int c = 0; c < 3; ++c)
        image(v, u)[c] = cv::saturate_cast<std::uint8_t>((150.0 + 12.0 * c) * light + gauss(random));
    }
  }
  return image;
}

}  // namespace omnifleet::ground::testing
