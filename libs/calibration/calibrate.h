#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "calibration/board.h"
#include "lens/camera.h"

namespace omnifleet::calibration {

/// One image in which the whole board was found.
struct View {
  std::string name;
  std::vector<Eigen::Vector2d> corners_px;  ///< in the order of Board::corners_m()
};

struct Calibration {
  lens::CameraModel model;
  std::vector<Eigen::Isometry3d> camera_from_board;  ///< of each view, optical frame
  double outermost_deg = 0.0;  ///< angle from the axis of the farthest corner; beyond it the model extrapolates
};

struct Request {
  lens::Projection projection = lens::Projection::kKannalaBrandt;
  int image_width_px = 0, image_height_px = 0;
  double fov_deg = 0.0;  ///< full angle that the lens must serve; 0: what the corners covered, and a tenth more
};

/// Intrinsics of a lens and the places of the board that make the corners' reprojection errors least (sum of
/// squares in pixels over all corners of all views; none left out, none weighted). Starts need no guess: an
/// ideal equidistant (or pinhole) lens whose focal length is searched for, each view's pose from the
/// homography between board and rays (valid beyond 90° too), then Levenberg–Marquardt on our own lens model
/// (Ceres), so that every projection of libs/lens can be had; OpenCV's cv::fisheye knows one and ends at 90°.
/// Throws std::runtime_error for fewer than 3 views or corners that no such lens explains, options::Error
/// where the result cannot be inverted over the field of view asked for.
Calibration calibrate(const std::vector<View>& views, const Board& board, const Request& request);

/// Root mean square of the distances (px) between the corners and their images through a lens; infinite where
/// the lens does not see a corner.
double reprojectionRms_px(const lens::Lens& lens, const Board& board, const View& view,
                          const Eigen::Isometry3d& camera_from_board);
/// The same over all corners of all views.
double reprojectionRms_px(const lens::Lens& lens, const Board& board, const std::vector<View>& views,
                          const std::vector<Eigen::Isometry3d>& camera_from_board);

}  // namespace omnifleet::calibration
