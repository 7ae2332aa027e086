#pragma once

#include <vector>

#include "tests/raycast/ray_caster.h"

namespace omnifleet::raycast {

/// Renders as render() does, several times faster: one ray per pixel, four where a neighbour shows another
/// solid, another side or another colour of a solid. Fine texture of the floor is averaged over the pixel.
/// Rays, noise and tone curve come from tables.
class AdaptiveRenderer {
 public:
  /// @param camera equidistant, equisolid or stereographic; room and camera must outlive the renderer
  AdaptiveRenderer(const Room& room, const lens::CameraModel& camera);
  ~AdaptiveRenderer();

  /// As render() in ray_caster.h.
  cv::Mat3b render(const Pose2& map_from_camera, const std::vector<Solid>& robots, unsigned frame) const;

 private:
  struct PixelRay;
  class Exposure;
  static constexpr int kBearings = 360;  ///< intervals, each with the solids that appear in it

  PixelRay rayAt(double u, double v) const;
  float toneAt(float linear) const;  ///< toneOf() with linear interpolation, exact to 0.1 grey levels

  const Room& room_;
  const lens::CameraModel& camera_;
  std::vector<PixelRay> rays_;  ///< row by row
  std::vector<float> tones_;
};

}  // namespace omnifleet::raycast
