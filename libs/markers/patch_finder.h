#pragma once

// Robots from their colour patches in a ceiling image (Choi et al. 2014 §V.2, Fig. 19: the team patch is the
// position, the line to the individual patch the heading). Departures from the paper: chroma normalised by
// the brightest channel instead of fixed RGB, pairs checked in metres on the plane of the markers, parallax
// corrected by their height, the position taken from both patches (docs/methods.md, "Ceiling patches").

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "lens/camera.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::markers {

struct FinderOptions {
  double chroma_tolerance = 0.16;  ///< 1, distance of max-normalised colours that still counts as the patch
  double min_brightness = 40;      ///< grey levels, brightest channel of a patch pixel
  double min_saturation = 0.25;    ///< 1, 1 − min/max of a patch pixel
  double distance_tolerance_m = 0.012;  ///< m, on the distance between the two patches
  double min_area_ratio = 0.45;         ///< 1, blob area ÷ expected patch area
  double max_area_ratio = 1.8;          ///< 1
  int border_px = 2;          ///< a blob nearer to the image border is cut: its centroid is not trusted, only
                              ///< the fit of its visible edges
  double max_fit_rms = 0.25;  ///< 1, rms of the coverage left by the fit of both rectangles
  double pixel_sigma_px = 0.15;  ///< px, of a centroid, for the covariance
  double gate_m = 0.30;          ///< m, a track's jump between frames beyond which it must be seen again
  int confirm_frames = 1;        ///< detections in a row before a new robot is reported
  int search_every_frames = 5;   ///< frames: how often the whole image is searched while all robots of the
                                 ///< set are found near where they were; 1: always
  double window_m = 0.20;        ///< m, how far a robot may have moved between two frames to be found there

  static FinderOptions read(const options::Section& section);
};

/// One robot in one image.
struct Detection {
  std::string robot;
  Pose2 map_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();    ///< x, y, θ; right perturbation
  Eigen::Vector2d team_px{0.0, 0.0}, individual_px{0.0, 0.0};  ///< sub-pixel centroids
  double score = 0.0;  ///< lower is better: sum of squared normalised deviations of distance and areas
};

/// A marker kind's finder; `team + individual patch` is one, other kinds derive likewise.
class MarkerFinder {
 public:
  virtual ~MarkerFinder() = default;
  /// Robots in a BGR image (CV_8UC3, the camera's size; throws std::runtime_error otherwise), sorted by
  /// robot, at most one per robot. Times increase.
  virtual const std::vector<Detection>& find(const cv::Mat& bgr, TimeNs time) = 0;

  /// The finder for the set's kind. Throws options::Error for a kind that has none.
  static std::unique_ptr<MarkerFinder> make(const lens::Camera& camera, const dataset::MarkerSet& markers,
                                            const FinderOptions& options);
};

}  // namespace omnifleet::markers
