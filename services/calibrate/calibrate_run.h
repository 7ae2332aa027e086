#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calibration/calibrate.h"

namespace omnifleet::calibrate {

struct Options {
  std::string images;       ///< folder of images; dataset/image_names.h lists the extensions
  std::string match = "*";  ///< shell pattern for the image names
  calibration::Board board;
  lens::Projection projection = lens::Projection::kKannalaBrandt;
  double fov_deg = 0.0;     ///< see calibration::Request
  double max_rms_px = 2.0;  ///< px; no file is written for a larger reprojection error
  std::string out;          ///< the sensor.yaml to write
};

struct Report {
  lens::CameraModel model;        ///< as read back from the written file
  std::vector<std::string> used;  ///< names of the images with a board
  std::vector<double> rms_px;
  std::vector<std::string> without_board;
  double total_rms_px = 0.0;  ///< over all corners of all used images
  double outermost_deg = 0.0;
};

/// The projection with this name, e.g. "kannala_brandt". Throws options::Error that lists the valid names.
lens::Projection projectionFromName(const std::string& name);

/// Finds the board in every image, calibrates, writes `out`, reads it back and computes the errors of the
/// read model. Uses every image that shows a whole board. `progress(name, found)` is called for each image.
/// Throws options::Error for unusable input (no images, unequal sizes, a field of view that cannot be
/// inverted). Throws std::runtime_error when the images are not sufficient, the error exceeds max_rms_px or
/// `out` cannot be written.
Report run(const Options& options, const std::function<void(const std::string&, bool)>& progress);

/// One line per image and a summary.
std::string table(const Report& report);

}  // namespace omnifleet::calibrate
