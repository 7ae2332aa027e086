#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// Pictures of an arena through one camera with any lens, traced on Embree. The floor needs no tracing (its
/// place per pixel is fixed in the camera's parent); tiles that may show a solid are traced, contours with
/// many rays per pixel. Equal (arena, camera, seed, frame) give equal pixels, whatever was rendered before.
class Renderer {
 public:
  /// Throws options::Error for a camera or lens that is not there, std::runtime_error when Embree fails.
  Renderer(const Arena& arena, const std::string& camera_id, std::uint32_t seed);
  ~Renderer();
  Renderer(Renderer&&) noexcept;
  Renderer& operator=(Renderer&&) noexcept;

  /// Draws frame number `frame` (its time is the arena's, it seeds the noise) with the robots at these poses,
  /// one per robot of the arena in its order. `bgr` is CV_8UC3 of the camera's size, written in place;
  /// allocated where empty. Throws std::runtime_error for another size or type, or another number of poses.
  void render(int frame, const std::vector<Pose2>& map_from_bases, cv::Mat& bgr);

  const lens::CameraModel& model() const;

 private:
  struct Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace omnifleet::synthetic
