#pragma once

// Images of blocks and walls on a floor by supersampled ray casting, with the exact distance per bearing. It
// shares nothing with the library under test but the lens.

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>
#include <random>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::test {

/// 320×240, height 8.5 cm, pitched 12° down, 90° horizontal field of view, mild distortion.
lens::CameraModel forwardCamera();

struct Block {
  Eigen::Vector2d centre_m{0, 0};
  Eigen::Vector2d half_m{0.05, 0.05};
  double yaw_rad = 0.0;
  double height_m = 0.15;
  cv::Vec3f bgr{60, 60, 160};
};

/// A dark, light or coloured area of the floor: a disc that multiplies its colour.
struct Spot {
  Eigen::Vector2d centre_m{0, 0};
  double radius_m = 0.1;
  cv::Vec3f factor{0.6f, 0.6f, 0.6f};
};

struct World {
  std::vector<Block> blocks;
  std::vector<Spot> spots;
  Eigen::Vector2d room_half_m{0, 0};  ///< walls at ±half; 0: no walls
  double wall_height_m = 0.4;
  cv::Vec3f wall_bgr[4]{{140, 120, 90}, {90, 110, 150}, {150, 150, 150}, {80, 140, 90}};
  cv::Vec3f floor_bgr{118, 122, 126};
  cv::Vec3f sky_bgr{220, 200, 180};
  double texture = 0.05;                                        ///< σ of the floor's brightness
  Eigen::Vector2d light_per_m{0, 0};                            ///< gradient of the brightness of everything
  double grid_m = 0.0, grid_line_m = 0.005, grid_factor = 0.6;  ///< dark lines; spacing 0: none
  std::uint32_t seed = 1;
};

/// Blocks and walls of several colours around the robot, the floor textured, the light uneven.
World randomWorld(std::uint32_t seed);

struct RobotPose {
  Eigen::Vector2d position_m{0, 0};
  double yaw_rad = 0.0;
};

class RayCaster {
 public:
  explicit RayCaster(const lens::Camera& camera, int samples = 4);

  /// Without noise: `noise_sigma` 0. Without JPEG: quality 0.
  cv::Mat render(const World& world, const RobotPose& pose, double noise_sigma = 2.0,
                 int jpeg_quality = 90) const;
  /// Distance from the camera's foot to the first side of a block or wall. Empty: none, or its foot lies
  /// outside the image.
  std::optional<double> truth(const World& world, const RobotPose& pose, double bearing_rad) const;

 private:
  struct Ray {
    float x, y, z;
  };
  cv::Vec3f trace(const World& world, const Eigen::Vector3d& from, const Eigen::Vector3d& along) const;

  lens::Camera camera_;
  int samples_;
  std::vector<Ray> rays_;
};

}  // namespace omnifleet::test
