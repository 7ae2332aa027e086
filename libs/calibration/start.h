#pragma once

// Where the solver starts: no guess of the user's is needed.

#include <vector>

#include "calibration/calibrate.h"

namespace omnifleet::calibration {

struct Start {
  double focal_px = 0.0;
  std::vector<Eigen::Isometry3d> camera_from_board;
};

/// Pose of a plane seen along rays (unit vectors, any angle): H with λ·ray = H·[X, Y, 1]ᵀ by least squares of
/// ray × H·X (direct linear transform, Hartley and Zisserman §4.1), then the nearest rotation.
Eigen::Isometry3d poseFromRays(const std::vector<Eigen::Vector2d>& plane_m,
                               const std::vector<Eigen::Vector3d>& rays);

/// The focal length of an ideal lens (r = F·θ, or F·tan θ for a pinhole) with its centre in the image's, under
/// which the views look most like planes.
Start findStart(const std::vector<View>& views, const Board& board, const Request& request);

}  // namespace omnifleet::calibration
