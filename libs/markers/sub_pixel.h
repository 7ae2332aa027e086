#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "lens/camera.h"
#include "markers/blobs.h"

namespace omnifleet::markers {

/// A pixel of a patch or near it: its position on the plane, and the share of it that the patch covers.
struct Sample {
  Eigen::Vector2d place_m;
  double coverage;
};

/// A patch on the plane of the markers.
struct Patch {
  std::uint8_t colour = 0;
  Eigen::Vector2d centre_px{0.0, 0.0};  ///< centroid of the coverage
  Eigen::Vector2d centre_m{0.0,
                           0.0};  ///< centroid on the plane, in map, weighted by the area of each pixel there
  double area_m2 = 0.0;
  double metres_per_px = 0.0;
  Eigen::Vector3d surround_bgr{0.0, 0.0, 0.0};  ///< median colour of the surrounding ring
  bool cut = false;                             ///< touches the image border, so only a part is visible
  std::vector<Sample> samples;                  ///< pixels of the patch and up to 2 px around it
};

/// Centroid from fractional coverage. The weight of a pixel near the blob is the position of its colour
/// between that of the surroundings and that of the patch, so edge pixels count by the covered part. The
/// accuracy is 0.02 px; the centroid of a mask has 0.1 px. Empty if the plane is not visible there or the
/// patch has no contrast.
std::optional<Patch> refine(const cv::Mat& bgr, const ColourTable& table, const Blob& blob,
                            const lens::Camera& camera, double plane_height_m);

}  // namespace omnifleet::markers
