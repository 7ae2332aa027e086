#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>

#include "lens/camera.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct ImageCircleOptions {
  double least_share = 0.3;      ///< of the directions in which the edge must be inside the image
  double most_spread = 0.02;     ///< σ of the edge's radius, as a share of it; more: it is not a circle
  double least_contrast = 20.0;  ///< grey levels between both sides of the edge
  double dark_level = 24.0;      ///< grey level, outside the circle at most
  double tolerance = 0.07;  ///< smaller differences from the model are not reported: a lens has a soft edge
  int frames = 10;          ///< the first valid frames are examined until one shows the edge

  static ImageCircleOptions read(const options::Section& section);
};

/// The edge of the round image of a fisheye lens.
struct ImageCircle {
  double radius_px = 0.0;  ///< median distance from the principal point
  double sigma_px = 0.0;   ///< of one direction
  double share = 0.0;      ///< of the directions in which the edge is inside the image
};

/// Looks for the edge along 180 directions from `centre_px`, inwards from the border of the image: dark
/// outside, lit inside, at one radius. Empty if no circle ends inside the image, or if it is too dark to say.
/// @param image BGR8 or grey
std::optional<ImageCircle> findImageCircle(const cv::Mat& image, const Eigen::Vector2d& centre_px,
                                           const ImageCircleOptions& options);

/// What the edge says about the lens of `sensor.yaml`.
struct LensVerdict {
  ImageCircle seen;
  double model_px =
      0.0;  ///< median radius of the model's field of view in these directions; 0: it has no edge
};

/// Empty if the image ends where the model says, or continues beyond (the user may have given less than the
/// lens shows). Otherwise the lens model is wrong: projection, focal length or field of view.
std::optional<LensVerdict> contradiction(const cv::Mat& image, const lens::CameraModel& model,
                                         const ImageCircleOptions& options);

}  // namespace omnifleet::local_mapper
