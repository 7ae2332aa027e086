#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "lens/camera.h"
#include "synthetic/renderer.h"

namespace omnifleet::synthetic::test {

/// A room with one plain colour, uniform ambient light and a sensor without noise. The value of a pixel then
/// gives the share of it that a solid covers.
Arena plainArena();

/// A small equidistant fisheye, 185°, half a metre above base_link, looking down.
lens::CameraModel smallFisheye();
/// A pinhole camera that looks straight down from `height_m` over the origin of map.
lens::CameraModel ceilingPinhole(double height_m);

/// Adds the camera to the ceiling of the arena as "ceiling/c".
void hangCamera(Arena& arena, const lens::CameraModel& model);
/// Adds a robot with that camera as "NAME/fisheye".
void addRobot(Arena& arena, const std::string& name, const Pose2& pose, const lens::CameraModel& model);

/// First solid that a ray from a point of map hits; −1: none. Closed forms (slabs, quadratic equations) in
/// double precision, independent of the renderer.
int firstSolid(const std::vector<Solid>& solids, const Eigen::Vector3d& from, const Eigen::Vector3d& ray);

/// Share of the pixel that any solid covers, from samples × samples rays of the exact lens.
double trueCoverage(const std::vector<Solid>& solids, const lens::Camera& camera,
                    const Pose2& map_from_parent, int u, int v, int samples);

/// Grey level of one channel.
inline double level(const cv::Mat& bgr, int u, int v, int channel) {
  return bgr.at<cv::Vec3b>(v, u)[channel];
}

}  // namespace omnifleet::synthetic::test
