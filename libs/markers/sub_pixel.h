#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "lens/camera.h"
#include "markers/blobs.h"

namespace omnifleet::markers {

/// A pixel at or near a patch: where it lies on the plane, and how much of it the patch covers.
struct Sample {
  Eigen::Vector2d place_m;
  double coverage;
};

/// A patch on the plane of the markers.
struct Patch {
  std::uint8_t colour = 0;
  Eigen::Vector2d centre_px{0.0, 0.0};  ///< centroid of the coverage
  Eigen::Vector2d centre_m{0.0, 0.0};   ///< centroid on the plane, map: weighted by each pixel's area there
  double area_m2 = 0.0;
  double metres_per_px = 0.0;
  Eigen::Vector3d surround_bgr{0.0, 0.0, 0.0};  ///< median colour of a ring around it
  bool cut = false;                             ///< reaches the image's border: only a part is seen
  std::vector<Sample> samples;                  ///< the patch's pixels and those up to 2 px around
};

/// Centroid from fractional coverage: each pixel near the blob counts by how far its colour lies from the
/// surroundings' to the patch's own, so that edge pixels count by the part the patch covers (a mask's
/// centroid is good to 0.1 px, this to 0.02). Nothing where the plane is not seen there or the patch has no
/// contrast.
std::optional<Patch> refine(const cv::Mat& bgr, const ColourTable& table, const Blob& blob,
                            const lens::Camera& camera, double plane_height_m);

}  // namespace omnifleet::markers
