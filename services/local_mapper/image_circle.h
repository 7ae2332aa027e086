#pragma once

#include <Eigen/Core>
#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "options/options.h"

namespace omnifleet::local_mapper {

struct ImageCircleOptions {
  int frames = 10;               ///< the first frames are examined until one shows the edge; 0: off
  double least_share = 0.3;      ///< 1, directions in which the edge must be inside the image
  double least_radius = 0.5;     ///< 1, of half the image's smaller side; a smaller round spot is a lamp's
  double most_spread = 0.02;     ///< 1, σ of the edge's radius as a share of it; more: it is no circle
  double least_contrast = 20.0;  ///< grey levels between both sides of the edge
  double dark_level = 24.0;      ///< grey level, outside the circle at most
  double tolerance = 0.07;       ///< 1, of an angle or a radius: soft edges of lenses, errors of calibrations
  double centre_tolerance = 0.1;   ///< 1, of the radius, between the circle's centre and the principal point:
                                   ///< a tilted or shifted field stop moves the centre by a few percent
  double widest_view_deg = 280.0;  ///< degrees: the widest fisheye lenses on the market (data sheets).
                                   ///< A stated fov_deg overrides both limits
  double narrowest_view_deg = 110.0;  ///< degrees: lenses with a round image are sold from about 140° on
                                      ///< (data sheets); narrower ones fill the sensor

  static ImageCircleOptions read(const options::Section& section);
};

/// The edge of the round image of a fisheye lens.
struct ImageCircle {
  Eigen::Vector2d centre_px{0.0, 0.0};
  double radius_px = 0.0;
  double sigma_px = 0.0;         ///< of one direction's edge
  double centre_sigma_px = 0.0;  ///< of the centre in its least certain direction
  double radius_sigma_px = 0.0;  ///< of the radius
  double share = 0.0;            ///< of the directions whose edge lies on the circle
};

/// Least-squares circle through most of the points. Points off the circle (dark objects at the rim, blooming
/// lamps) are rejected: first least median of squares over circles through three points (Rousseeuw 1984),
/// then geometric least squares over the points within 2.5 σ. Empty for fewer than 8 points, or if they lie
/// on a line.
std::optional<ImageCircle> fitCircle(const std::vector<Eigen::Vector2d>& points_px);

/// Looks for the edge along 180 directions from the centre of the image, inwards from its border: dark
/// outside, lit inside. Fits a circle. Empty if no circle ends inside the image, or if it is too dark to
/// decide.
/// @param image BGR8 or grey
std::optional<ImageCircle> findImageCircle(const cv::Mat& image, const ImageCircleOptions& options);

}  // namespace omnifleet::local_mapper
