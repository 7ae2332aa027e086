#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// Renders images of an arena through one camera with any lens, by ray tracing with Embree. The floor is not
/// traced, because its position per pixel is constant in the parent frame of the camera. Tiles that may show
/// a solid are traced, contours with many rays per pixel. Equal arena, camera, seed and frame number give
/// equal pixels, independent of earlier images.
class Renderer {
 public:
  /// Throws options::Error if the camera does not exist or its lens is invalid, std::runtime_error when
  /// Embree fails.
  Renderer(const Arena& arena, const std::string& camera_id, std::uint32_t seed);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  /// Renders frame number `frame`, which determines the time in the arena and the noise, with the robots at
  /// these poses, one per robot of the arena in its order. `bgr` is CV_8UC3 with the size of the camera and
  /// is written in place; it is allocated if empty. Throws std::runtime_error for another size or type, or a
  /// wrong number of poses.
  void render(int frame, const std::vector<Pose2>& map_from_bases, cv::Mat& bgr);

  const lens::CameraModel& model() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace omnifleet::synthetic
