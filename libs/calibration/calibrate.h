#pragma once

#include <Eigen/Geometry>
#include <string>
#include <vector>

#include "calibration/board.h"
#include "lens/camera.h"

namespace omnifleet::calibration {

/// One image in which all corners of the board were found.
struct View {
  std::string name;
  std::vector<Eigen::Vector2d> corners_px;  ///< in the order of Board::corners_m()
};

struct Calibration {
  lens::CameraModel model;
  std::vector<Eigen::Isometry3d> camera_from_board;  ///< one pose per view, optical frame
  double outermost_deg =
      0.0;  ///< angle of the farthest corner from the axis; beyond it the model extrapolates
};

struct Request {
  lens::Projection projection = lens::Projection::kKannalaBrandt;
  int image_width_px = 0, image_height_px = 0;
  double fov_deg =
      0.0;  ///< full angle that the lens must support; 0: 1.1 times the angle that the corners span
};

/// Estimates the intrinsics of a lens and the poses of the board. Minimises the reprojection error: the sum
/// of squares in pixels over all corners of all views, without weights or rejection. No initial guess is
/// needed. The focal length of an ideal equidistant (or pinhole) lens is searched for. The pose of each view
/// follows from the homography between board and rays, which is valid beyond 90°. Then Levenberg–Marquardt
/// (Ceres) runs on the lens model of libs/lens, so that every projection is available; OpenCV's cv::fisheye
/// has one and ends at 90°. Throws std::runtime_error for fewer than 3 views or corners that no such lens
/// fits. Throws options::Error if the result cannot be inverted over the requested field of view.
Calibration calibrate(const std::vector<View>& views, const Board& board, const Request& request);

/// Root mean square of the distances (px) between the corners and their projections. Infinite if the lens
/// does not see a corner.
double reprojectionRms_px(const lens::Lens& lens, const Board& board, const View& view,
                          const Eigen::Isometry3d& camera_from_board);
/// The same RMS over all corners of all views.
double reprojectionRms_px(const lens::Lens& lens, const Board& board, const std::vector<View>& views,
                          const std::vector<Eigen::Isometry3d>& camera_from_board);

}  // namespace omnifleet::calibration
