#pragma once

// A fisheye camera above a floor and images of that floor in uneven light, for the tests of `ground`.

#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <random>

#include "ground/floor_view.h"
#include "lens/camera.h"

namespace omnifleet::ground::testing {

inline lens::CameraModel fisheye(int width = 640, int height = 480) {
  lens::CameraModel model;
  model.projection = lens::Projection::kEquidistant;
  model.image_width_px = width;
  model.image_height_px = height;
  model.focal_px = Eigen::Vector2d::Constant(0.2323 * width);
  model.principal_point_px = {0.5 * (width - 1), 0.5 * (height - 1)};
  model.fov_deg = 185.0;
  model.position_m = {0.0, 0.0, 0.5};
  model.self_mask_radius_px = 0.155 * width;
  return model;
}

/// Greyish floor whose light decreases outward to `far_share` of the centre's, with noise (σ in grey levels).
inline cv::Mat3b unevenFloor(const lens::CameraModel& model, double far_share, double noise, unsigned seed) {
  cv::Mat3b image(model.image_height_px, model.image_width_px);
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss(0.0, noise);
  const double rim = 0.36 * model.image_width_px;
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      const double r = std::hypot(x - model.principal_point_px.x(), y - model.principal_point_px.y()) / rim;
      const double light = 1.0 - (1.0 - far_share) * std::min(1.0, r * r);
      for (int c = 0; c < 3; ++c)
        image(y, x)[c] = cv::saturate_cast<std::uint8_t>((150.0 + 12.0 * c) * light + gauss(random));
    }
  }
  return image;
}

/// Copy of an image with noise (σ in grey levels) on each channel of each pixel.
inline cv::Mat3b withNoise(const cv::Mat3b& image, double noise, unsigned seed) {
  cv::Mat3b noisy = image.clone();
  std::mt19937 random(seed);
  std::normal_distribution<double> gauss(0.0, 1.0);
  for (auto& pixel : noisy)
    for (int c = 0; c < 3; ++c) pixel[c] = cv::saturate_cast<std::uint8_t>(pixel[c] + noise * gauss(random));
  return noisy;
}

/// The same floor in dim light: grey level `level` in the centre.
inline cv::Mat3b dimFloor(const lens::CameraModel& model, double level, double noise, unsigned seed) {
  cv::Mat3b image = unevenFloor(model, 0.7, 0.0, seed);
  for (auto& pixel : image)
    for (int c = 0; c < 3; ++c) pixel[c] = cv::saturate_cast<std::uint8_t>(pixel[c] * level / 160.0);
  return withNoise(image, noise, seed);
}

inline cv::Mat3b blurred(const cv::Mat3b& image, double sigma_px) {
  cv::Mat3b out;
  cv::GaussianBlur(image, out, {}, sigma_px);
  return out;
}

/// Anti-aliased filled disc. Each pixel is weighted by its share inside the disc (8×8 samples).
template <typename Pixel, int kChannels = static_cast<int>(sizeof(Pixel))>
void drawDisc(cv::Mat_<Pixel>& image, double u, double v, double radius, const Pixel& colour) {
  for (int y = 0; y < image.rows; ++y) {
    for (int x = 0; x < image.cols; ++x) {
      if (std::hypot(x - u, y - v) > radius + 2.0) continue;
      int inside = 0;
      for (int i = 0; i < 64; ++i)
        if (std::hypot(x - 0.5 + (i % 8 + 0.5) / 8 - u, y - 0.5 + (i / 8 + 0.5) / 8 - v) <= radius) ++inside;
      auto* to = reinterpret_cast<std::uint8_t*>(&image(y, x));
      const auto* from = reinterpret_cast<const std::uint8_t*>(&colour);
      for (int c = 0; c < kChannels; ++c)
        to[c] = cv::saturate_cast<std::uint8_t>(from[c] * (inside / 64.0) + to[c] * (1.0 - inside / 64.0));
    }
  }
}

}  // namespace omnifleet::ground::testing
