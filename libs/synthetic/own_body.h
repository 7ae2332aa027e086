#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "lens/camera.h"
#include "synthetic/arena.h"
#include "synthetic/pixel_table.h"

namespace omnifleet::synthetic {

/// A pixel that shows the robot that carries the camera, wholly (share 1) or in part.
struct OwnPixel {
  std::uint32_t index = 0;
  float share = 1.0f;
  Eigen::Array4f bgr = Eigen::Array4f::Zero();  ///< mean colour of that share, in full light
};

/// The own body as the camera always sees it: the self mask. Empty where the camera sits inside the body or
/// on the ceiling. `samples` rays per axis on its contours.
std::vector<OwnPixel> ownBodyPixels(const Arena& arena, int robot, const lens::Camera& camera,
                                    const PixelTable& pixels, std::uint32_t seed);

}  // namespace omnifleet::synthetic
