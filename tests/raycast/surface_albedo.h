#pragma once

#include "tests/raycast/ray_caster.h"

namespace omnifleet::raycast {

/// Linear albedo of the floor with its markings.
/// @param blur_m width of the pixel on the floor, over which fine texture is averaged; 0: a point
Eigen::Vector3d floorAlbedo(const Room& room, const Eigen::Vector2d& at, double blur_m);

/// Linear albedo of a solid. `own` and `own_normal` are the point and the normal in the frame of the solid.
Eigen::Vector3d solidAlbedo(const Room& room, const Solid& solid, const Eigen::Vector3d& at,
                            const Eigen::Vector3d& own, const Eigen::Vector3d& own_normal);

}  // namespace omnifleet::raycast
