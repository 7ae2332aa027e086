#pragma once

// The drive of a simulated Mars rover (data set forward_rover): its log, its camera and its true map.

#include <Eigen/Core>
#include <functional>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "geometry/pose2.h"
#include "lens/camera.h"
#include "observation/observation.h"

namespace omnifleet::test {

/// One frame of the drive.
struct RoverStep {
  std::string image;      ///< path
  TimeNs time_ns = 0;     ///< since the first frame, from the name of the image
  Pose2 map_from_base;    ///< in the frame of the true map: cell (column, row) = (⌊x⌋, ⌊y⌋)
  double tilt_deg = 0.0;  ///< the larger one of pitch and roll
};

/// The camera of the rover, in the rover's frame. From the corners of a square of 1 m in the grid image.
lens::CameraModel roverCamera();

/// Rows of the log whose image exists. `folder`: forward_rover.
std::vector<RoverStep> roverSteps(const std::string& folder);

/// 200 × 200 cells of 1 m; not 0: navigable. Empty if the file is missing.
cv::Mat1b roverMap(const std::string& folder);

/// Calls each(cell) along a ray on the map, from 0.5 m on, 0.1 m at a time, until it returns false.
void alongRoverMap(const Eigen::Vector2d& from_m, double heading_rad, double to_m,
                   const std::function<bool(const cv::Point&)>& each);

/// Navigable cells in sight of the camera at any of the steps: within ±54° and the measured range, not behind
/// others.
cv::Mat1b roverSight(const cv::Mat1b& map, const std::vector<RoverStep>& steps, double reach_m);

}  // namespace omnifleet::test
