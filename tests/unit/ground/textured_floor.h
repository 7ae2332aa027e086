#pragma once

// Images of a floor with random texture, rendered through a lens. Independent of the code under test.

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "geometry/pose2.h"
#include "ground/floor_view.h"
#include "lens/camera.h"
#include "tests/unit/ground/synthetic_floor.h"

namespace omnifleet::ground::testing {

/// Random texture with mean 0 and standard deviation 1 in a square of 4 m around the origin of map.
class FloorTexture {
 public:
  FloorTexture(double sigma_m, unsigned seed) : map_(kSide, kSide) {
    cv::RNG random(seed);
    random.fill(map_, cv::RNG::NORMAL, 0.0, 1.0);
    cv::GaussianBlur(map_, map_, {}, sigma_m / kStep_m);
    cv::Scalar mean, sigma;
    cv::meanStdDev(map_, mean, sigma);
    map_ = (map_ - mean[0]) / sigma[0];
  }
  double at(const Eigen::Vector2d& point) const {
    const double u = std::clamp(point.x() / kStep_m + 0.5 * kSide, 0.0, kSide - 1.01),
                 v = std::clamp(point.y() / kStep_m + 0.5 * kSide, 0.0, kSide - 1.01);
    const int i = static_cast<int>(u), j = static_cast<int>(v);
    const double f = u - i, g = v - j;
    return (1 - g) * ((1 - f) * map_(j, i) + f * map_(j, i + 1)) +
           g * ((1 - f) * map_(j + 1, i) + f * map_(j + 1, i + 1));
  }

 private:
  static constexpr int kSide = 1600;
  static constexpr double kStep_m = 0.0025;
  cv::Mat1f map_;
};

struct FloorLook {
  double contrast = 0.05;  ///< σ of the texture ÷ brightness
  double gain = 1.0, noise = 1.5;
  bool has_shadow = false;  ///< of the robot, on the same pixels in each frame
  double dirt = 0.0;        ///< σ of a texture that is fixed in the image ÷ brightness
};

/// Renders a floor through the lens; each pixel is the mean of four rays.
class TexturedFloor {
 public:
  explicit TexturedFloor(int width = 640, int height = 480)
      : camera(fisheye(width, height)), view(camera, ViewOptions{}) {
    const auto& model = camera.model();
    for (int v = 0; v < model.image_height_px; ++v)
      for (int u = 0; u < model.image_width_px; ++u)
        for (const auto& off : {Eigen::Vector2d(-0.25, -0.25), Eigen::Vector2d(0.25, -0.25),
                                Eigen::Vector2d(-0.25, 0.25), Eigen::Vector2d(0.25, 0.25)}) {
          const auto point = camera.floorFromPixel(Eigen::Vector2d(u, v) + off);
          points_.push_back(point && point->norm() < 1.5 ? *point : Eigen::Vector2d(NAN, NAN));
        }
  }

  cv::Mat1b image(const FloorTexture& texture, const Pose2& map_from_base, const FloorLook& look,
                  unsigned seed) const {
    const auto& model = camera.model();
    cv::Mat1b image(model.image_height_px, model.image_width_px, std::uint8_t{0});
    std::mt19937 random(seed);
    std::normal_distribution<double> noise(0.0, look.noise);
    const Eigen::Matrix2d rotation = map_from_base.rotation();
    const Eigen::Vector2d translation = map_from_base.translation();
    for (std::size_t i = 0; i < image.total(); ++i) {
      const Eigen::Vector2d& first = points_[4 * i];
      if (std::isnan((points_[4 * i] + points_[4 * i + 1] + points_[4 * i + 2] + points_[4 * i + 3]).x()))
        continue;
      double sum = 0.0;
      if (look.contrast > 0.0)
        for (std::size_t k = 0; k < 4; ++k) sum += texture.at(rotation * points_[4 * i + k] + translation);
      double light = 130.0 * (1.0 - 0.15 * first.squaredNorm());
      if (look.dirt > 0.0) light *= 1.0 + look.dirt * dirt_.at(first);
      if (look.has_shadow && std::abs(first.y() - 0.3) < 0.12 && first.x() > 0.0) light *= 0.6;
      image.data[i] = cv::saturate_cast<std::uint8_t>(look.gain * light * (1.0 + look.contrast * 0.25 * sum) +
                                                      noise(random));
    }
    return image;
  }

  lens::Camera camera;
  FloorView view;

 private:
  std::vector<Eigen::Vector2d> points_;  ///< four per pixel
  FloorTexture dirt_{0.008, 99};
};

inline const TexturedFloor& texturedFloor() {
  static const TexturedFloor scene;
  return scene;
}

}  // namespace omnifleet::ground::testing
