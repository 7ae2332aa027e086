#pragma once

// Small exact renderings for the tests of the stage: a floor and prisms on it, seen by a fisheye camera.
// Every pixel is the mean of its samples, so outlines are anti-aliased. The exact silhouette of a prism
// determines what it hides.

#include <opencv2/core.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "lens/camera.h"
#include "local_mapper/frame_check.h"

namespace omnifleet::local_mapper::testing {

struct Prism {
  Polygon footprint_m;  ///< world
  double height_m = 0.1;
  cv::Vec3b colour{40, 40, 200};
};

struct Scene {
  std::vector<Prism> prisms;
  cv::Vec3b floor{150, 160, 170};
  double noise = 1.0;  ///< σ in grey levels
  unsigned seed = 1;
};

lens::CameraModel fisheyeModel();

/// @param samples per axis and pixel
cv::Mat3b renderScene(const Scene& scene, const lens::Camera& camera, const Pose2& world_from_base,
                      int samples = 3);

Polygon box(double x, double y, double width, double depth, double angle_rad);

Frame frameOf(const cv::Mat& image, std::uint32_t sequence);

}  // namespace omnifleet::local_mapper::testing
