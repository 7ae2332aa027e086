#pragma once

#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "calibration/calibrate.h"

namespace omnifleet::calibration::test {

inline lens::CameraModel lensModel(lens::Projection projection) {
  lens::CameraModel m;
  m.projection = projection;
  m.image_width_px = 800;
  m.image_height_px = 640;
  m.focal_px = {211.5, 209.8};
  m.principal_point_px = {403.7, 314.2};
  m.fov_deg = projection == lens::Projection::kOrthographic ? 170.0 : 185.0;
  if (projection == lens::Projection::kKannalaBrandt) m.distortion = {0.021, -0.008, 0.0031, -0.0007};
  if (projection == lens::Projection::kOcam)
    m.distortion = {-211.5, 0.0, 1.6e-3, -4.1e-7, 3.9e-9, 0.9985, 8e-4, 0.0};
  if (projection == lens::Projection::kPinhole) {
    m.kind = lens::CameraKind::kPinhole;
    m.focal_px = {520.4, 517.9};
    m.distortion = {-0.21, 0.06, 0.0011, -0.0007, -0.004};
  }
  return m;
}

/// A board whose centre lies at an angle from the axis, turned towards the camera and then tilted.
inline Eigen::Isometry3d boardAt(const Board& board, double theta_rad, double azimuth_rad, double distance_m,
                                 const Eigen::Vector3d& tilt_rad) {
  const Eigen::Vector3d to(std::sin(theta_rad) * std::cos(azimuth_rad),
                           std::sin(theta_rad) * std::sin(azimuth_rad), std::cos(theta_rad));
  Eigen::Isometry3d pose = Eigen::Isometry3d::Identity();
  pose.translation() = distance_m * to;
  pose.linear() = Eigen::Quaterniond::FromTwoVectors(Eigen::Vector3d::UnitZ(), to).toRotationMatrix() *
                  (Eigen::AngleAxisd(tilt_rad.z(), Eigen::Vector3d::UnitZ()) *
                   Eigen::AngleAxisd(tilt_rad.y(), Eigen::Vector3d::UnitY()) *
                   Eigen::AngleAxisd(tilt_rad.x(), Eigen::Vector3d::UnitX()))
                      .toRotationMatrix();
  const Eigen::Vector2d middle = 0.5 * board.corners_m().back();
  return pose * Eigen::Translation3d(-middle.x(), -middle.y(), 0.0);
}

/// Poses over the whole field of view up to `last_rad` (centre of the board), at all azimuths, with random
/// tilts.
inline std::vector<Eigen::Isometry3d> placesOf(const Board& board, double last_rad, int count,
                                               unsigned seed) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<double> tilt(-0.5, 0.5), distance(0.35, 0.6);
  std::vector<Eigen::Isometry3d> poses;
  for (int i = 0; i < count; ++i) {
    const double theta = last_rad * (i + 0.5) / count, azimuth = 2.4 * i;
    const Eigen::Vector3d turn(tilt(random), tilt(random), tilt(random));
    poses.push_back(boardAt(board, theta, azimuth, distance(random), turn));
  }
  return poses;
}

inline View viewOf(const lens::Lens& lens, const Board& board, const Eigen::Isometry3d& pose) {
  View view{"synthetic", {}};
  for (const Eigen::Vector2d& place : board.corners_m()) {
    const auto pixel = lens.pixelFromRay(pose * Eigen::Vector3d(place.x(), place.y(), 0.0));
    if (pixel) view.corners_px.push_back(*pixel);
  }
  return view;
}

/// The board with a white margin one square wide on grey ground, 5×5 rays per pixel.
inline cv::Mat picture(const lens::CameraModel& model, const Board& board, const Eigen::Isometry3d& pose) {
  const auto lens = lens::Lens::make(model);
  const Eigen::Isometry3d board_from_camera = pose.inverse();
  cv::Mat image(model.image_height_px, model.image_width_px, CV_8U);
  const auto brightness = [&](double u, double v) {
    const auto ray = lens->rayFromPixel({u, v});
    if (!ray) return 0.0;
    const Eigen::Vector3d from = board_from_camera.translation(), along = board_from_camera.linear() * *ray;
    const double t = -from.z() / along.z();
    if (!(t > 0.0)) return 110.0;
    const double x = (from.x() + t * along.x()) / board.square_m,
                 y = (from.y() + t * along.y()) / board.square_m;
    if (x < -2 || y < -2 || x > board.columns + 1 || y > board.rows + 1) return 110.0;
    if (x < -1 || y < -1 || x > board.columns || y > board.rows) return 235.0;
    return (static_cast<int>(std::floor(x)) + static_cast<int>(std::floor(y))) % 2 == 0 ? 25.0 : 235.0;
  };
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      double sum = 0.0;
      for (int k = 0; k < 25; ++k) sum += brightness(u + (k % 5 - 2) * 0.2, v + (k / 5 - 2) * 0.2);
      image.at<std::uint8_t>(v, u) = static_cast<std::uint8_t>(sum / 25.0 + 0.5);
    }
  }
  return image;
}

}  // namespace omnifleet::calibration::test
