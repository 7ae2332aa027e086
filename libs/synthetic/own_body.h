#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "lens/camera.h"
#include "synthetic/arena.h"
#include "synthetic/pixel_table.h"

namespace omnifleet::synthetic {

/// A pixel that shows the robot that carries the camera, completely (share 1) or partly.
struct OwnPixel {
  std::uint32_t index = 0;
  float share = 1.0f;
  Eigen::Array4f bgr = Eigen::Array4f::Zero();  ///< mean colour of that share in full light
};

/// Pixels of the own body, which are the same in every image: the self mask. Contour pixels are averaged over
/// several rays. Empty if the camera is inside the body or on the ceiling.
std::vector<OwnPixel> ownBodyPixels(const Arena& arena, int robot, const lens::Camera& camera,
                                    const PixelTable& pixels, std::uint32_t seed);

}  // namespace omnifleet::synthetic
