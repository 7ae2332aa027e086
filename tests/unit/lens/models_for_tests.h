#pragma once

#include <cmath>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::lens::test {

inline constexpr double kDeg = M_PI / 180.0;

inline CameraModel model(Projection projection, double fov_deg = 185.0) {
  CameraModel m;
  m.projection = projection;
  m.image_width_px = 1280;
  m.image_height_px = 960;
  m.focal_px = {297.3, 296.1};
  m.principal_point_px = {641.3, 478.2};
  m.fov_deg = fov_deg;
  return m;
}

/// The simulated camera of CVSystem, calibrated by its authors with OCamCalib (see the README of the test
/// data): xc = 960.6058 (row), yc = 960.5975 (column), 1-based.
inline CameraModel simulatedOcam(double fov_deg = 185.0) {
  CameraModel m = model(Projection::kOcam, fov_deg);
  m.image_width_px = m.image_height_px = 1920;
  m.principal_point_px = {960.5975 - 1.0, 960.6058 - 1.0};
  m.distortion = {-611.6546, 0.0, 5.8327e-04, -1.2432e-07, 2.1582e-10, 0.9998, 2.0141e-04, -2.1536e-04};
  return m;
}

/// The same camera in the Kannala–Brandt model, calibrated independently (RMS 0.28 px).
inline CameraModel simulatedKannalaBrandt(double fov_deg = 185.0) {
  CameraModel m = model(Projection::kKannalaBrandt, fov_deg);
  m.image_width_px = m.image_height_px = 1920;
  m.focal_px = {610.694, 610.568};
  m.principal_point_px = {959.731, 959.739};
  m.distortion = {0.001698, -0.002884, 0.001993, -0.00049};
  return m;
}

inline CameraModel pinhole(const std::vector<double>& distortion) {
  CameraModel m = model(Projection::kPinhole);
  m.kind = CameraKind::kPinhole;
  m.focal_px = {820.0, 815.0};
  m.distortion = distortion;
  return m;
}

/// Unit ray at an angle from the axis and an azimuth in the image.
inline Eigen::Vector3d rayAt(double theta_rad, double azimuth_rad) {
  return {std::sin(theta_rad) * std::cos(azimuth_rad), std::sin(theta_rad) * std::sin(azimuth_rad),
          std::cos(theta_rad)};
}

}  // namespace omnifleet::lens::test
