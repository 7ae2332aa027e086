#pragma once

#include <functional>
#include <string>
#include <vector>

#include "calibration/calibrate.h"

namespace omnifleet::calibrate {

struct Options {
  std::string images;       ///< folder of .jpg, .jpeg, .png, .bmp images
  std::string match = "*";  ///< shell pattern of the names that count
  calibration::Board board;
  lens::Projection projection = lens::Projection::kKannalaBrandt;
  double fov_deg = 0.0;     ///< see calibration::Request
  double max_rms_px = 2.0;  ///< pixels: nothing is written where the reprojection error is larger
  std::string out;          ///< the sensor.yaml to write
};

struct Report {
  lens::CameraModel model;        ///< as read back from the written file
  std::vector<std::string> used;  ///< images, each with its error below
  std::vector<double> rms_px;
  std::vector<std::string> without_board;
  double total_rms_px = 0.0;  ///< over all corners of all images in which the board was found
  double outermost_deg = 0.0;
};

/// "kannala_brandt" → its projection; the error lists the names. Throws options::Error.
lens::Projection projectionFromName(const std::string& name);

/// Finds the board in every image, calibrates, writes `out`, reads it back and measures the errors of what
/// was read. No image is left out but those without a whole board. `progress(name, found)` is told of each
/// image. Throws options::Error for unusable input (no images, unequal sizes, a field of view that cannot be
/// inverted), std::runtime_error where the images do not suffice, the error is above max_rms_px or `out`
/// cannot be written.
Report run(const Options& options, const std::function<void(const std::string&, bool)>& progress);

/// A line per image and the sum.
std::string table(const Report& report);

}  // namespace omnifleet::calibrate
