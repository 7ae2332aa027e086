#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "appearance/panorama.h"
#include "geometry/pose2.h"

namespace omnifleet::test {

/// A rectangular room around the origin with smoothly textured walls and a plain floor, in closed form: the
/// grey level of a ray is that of the point where it meets the nearest wall or the floor.
class TexturedRoom {
 public:
  /// @param half_m half of its length and width
  explicit TexturedRoom(unsigned seed, Eigen::Vector2d half_m = {2.6, 2.1});

  double grey(const Pose2& map_from_base, double camera_height_m, double bearing_rad,
              double elevation_rad) const;

  /// The panorama of a camera 0.5 m above base_link, without an image in between. Each cell is the mean of 3
  /// × 3 rays.
  cv::Mat1b panorama(const Pose2& map_from_base, const appearance::PanoramaOptions& options) const;

 private:
  struct Wave {
    double along, up, phase, amplitude;  ///< radians per metre
  };
  Eigen::Vector2d half_m_;
  std::array<std::vector<Wave>, 4> waves_;
  std::array<double, 4> base_{};
};

/// Table whose panoramas have the geometry of TexturedRoom::panorama(); no image is unwrapped with it.
appearance::Unwrapper roomUnwrapper(const appearance::PanoramaOptions& options = {});

}  // namespace omnifleet::test
