#pragma once

// Detects robots by their coloured markers in a ceiling image. Kind `patches`: Choi et al. 2014 §V.2, Fig. 19
// (the team patch gives the position, the line to the individual patch the heading). Kind `cover_tail_head`:
// Ahmed et al. 2013 §2.2, Fig. 2a (three regions whose colours identify the robot). Differences to the
// papers: the chroma is normalised by the brightest channel instead of fixed RGB values, the height of the
// markers corrects the parallax, and a template of all rectangles is fitted to the image
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
  double distance_tolerance_m = 0.012;  ///< m, tolerance of the distance between two regions of a marker
  double min_area_ratio = 0.3;          ///< 1, blob area ÷ expected area of the region
  double max_area_ratio = 1.8;          ///< 1, see min_area_ratio
  int border_px = 2;          ///< px; a blob closer to the image border is cut: its centroid is not reliable
  double max_fit_rms = 0.25;  ///< 1, maximum rms of the residuals after the fit, relative to the contrast
  double max_misfit = 0.25;   ///< 1, maximum share of the marker's pixels that do not fit (occluded)
  double max_scale_error = 0.035;  ///< 1, maximum deviation of the marker's size from the expected one
  double scale_sigma = 0.02;       ///< 1, σ of the size: print, height_m and focal length
  /// 1, exponent of light by grey level of the camera's tone curve. 1: grey levels are mixed at edges, as in
  /// simple renderers; 2.2: sRGB, as in most cameras.
  double tone_gamma = 1.0;
  double pixel_sigma_px = 0.05;  ///< px, σ of the position from an inexact lens model, for the covariance
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
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< x, y, θ; right perturbation
  /// Centres of the team and the individual patch; cover_tail_head: of tail and head.
  Eigen::Vector2d team_px{0.0, 0.0}, individual_px{0.0, 0.0};
  Eigen::Vector2d blur_px{0.0, 0.0};  ///< σ of luma and chroma in the image, with the width of a pixel
  double scale = 1.0;                 ///< size in the image ÷ expected size
  double score = 0.0;  ///< lower is better: residual of the fit ÷ contrast + share of pixels that do not fit
};

/// Markers with one robot's colours at several places of an image.
struct Conflict {
  std::string robot;
  std::vector<Pose2> map_from_base;  ///< of all of them
  bool decided = false;  ///< true: one of them is reported, because it continues the robot's track or only
                         ///< its size is right. False: none is reported
};

/// Interface of a marker detector.
class MarkerFinder {
 public:
  virtual ~MarkerFinder() = default;
  /// Detects the robots in a BGR image, sorted by name, at most one detection per robot. Times must increase.
  /// Throws std::runtime_error unless the image is CV_8UC3 and has the size of the camera.
  virtual const std::vector<Detection>& find(const cv::Mat& bgr, TimeNs time) = 0;

  /// Robots whose colours were found at several places in the last search of the whole image, sorted by name.
  virtual const std::vector<Conflict>& conflicts() const = 0;

  /// Creates the detector for a marker set of any kind. Throws options::Error that names robot and key when a
  /// colour is not usable, two robots cannot be distinguished or the markers are not below the camera.
  static std::unique_ptr<MarkerFinder> make(const lens::Camera& camera, const dataset::MarkerSet& markers,
                                            const FinderOptions& options);
};

}  // namespace omnifleet::markers
