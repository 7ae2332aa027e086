#pragma once

// Detects robots by their colour patches in a ceiling image (Choi et al. 2014 §V.2, Fig. 19: the team patch
// gives the position, the line to the individual patch the heading). Differences to the paper: the chroma is
// normalised by the brightest channel instead of fixed RGB values, pairs are tested in metres on the plane of
// the markers, their height corrects the parallax, and both patches give the position
// (docs/methods/ceiling.md).

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
  double chroma_tolerance = 0.16;  ///< 1, maximum distance between max-normalised colours of patch and pixel
  double min_brightness = 40;      ///< grey levels, brightest channel of a patch pixel
  double min_saturation = 0.25;    ///< 1, 1 − min/max of a patch pixel
  double distance_tolerance_m = 0.012;  ///< m, tolerance of the distance between the two patches
  double min_area_ratio = 0.45;         ///< 1, blob area ÷ expected patch area
  double max_area_ratio = 1.8;          ///< 1, see min_area_ratio
  int border_px = 2;          ///< px; a blob closer to the image border is cut. Its centroid is not used,
                              ///< only the fit of its visible edges
  double max_fit_rms = 0.25;  ///< 1, maximum rms of the coverage residuals after the fit of both rectangles
  double pixel_sigma_px = 0.15;  ///< px, σ of a centroid, for the covariance
  double gate_m = 0.30;         ///< m, jump between frames beyond which the robot must be found a second time
  int confirm_frames = 1;       ///< consecutive detections before a new robot is reported
  int search_every_frames = 5;  ///< frames between searches of the whole image while all robots of the
                                ///< set are found near their last positions; 1: search every frame
  double window_m = 0.20;       ///< m, maximum motion of a robot between two frames within its window

  static FinderOptions read(const options::Section& section);
};

/// Detection of one robot in one image.
struct Detection {
  std::string robot;
  Pose2 map_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();    ///< x, y, θ; right perturbation
  Eigen::Vector2d team_px{0.0, 0.0}, individual_px{0.0, 0.0};  ///< sub-pixel centroids
  double score = 0.0;  ///< lower is better: sum of squared normalised deviations of distance and areas
};

/// Interface of a marker detector. Each marker kind derives a class; `patches` is implemented.
class MarkerFinder {
 public:
  virtual ~MarkerFinder() = default;
  /// Detects the robots in a BGR image, sorted by name, at most one detection per robot. Times must increase.
  /// Throws std::runtime_error unless the image is CV_8UC3 and has the size of the camera.
  virtual const std::vector<Detection>& find(const cv::Mat& bgr, TimeNs time) = 0;

  /// Creates the detector for the kind of the marker set. Throws options::Error for a kind without a
  /// detector.
  static std::unique_ptr<MarkerFinder> make(const lens::Camera& camera, const dataset::MarkerSet& markers,
                                            const FinderOptions& options);
};

}  // namespace omnifleet::markers
