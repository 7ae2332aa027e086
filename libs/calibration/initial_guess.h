#pragma once

// Initial guess of the solver, computed from the views alone.

#include <vector>

#include "calibration/calibrate.h"

namespace omnifleet::calibration {

struct InitialGuess {
  double focal_px = 0.0;
  std::vector<Eigen::Isometry3d> camera_from_board;
};

/// Pose of a plane that is seen along rays (unit vectors, any angle). H with λ·ray = H·[X, Y, 1]ᵀ by least
/// squares of ray × H·X (direct linear transform, Hartley and Zisserman §4.1), then the nearest rotation.
Eigen::Isometry3d poseFromRays(const std::vector<Eigen::Vector2d>& plane_m,
                               const std::vector<Eigen::Vector3d>& rays);

/// Focal length of an ideal lens (r = F·θ, or F·tan θ for a pinhole) centred in the image, for which the
/// views fit planes best.
InitialGuess findInitialGuess(const std::vector<View>& views, const Board& board, const Request& request);

}  // namespace omnifleet::calibration
