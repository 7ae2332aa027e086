#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "appearance/unwrap_kernel.h"
#include "lens/camera.h"
#include "options/options.h"

namespace omnifleet::appearance {

struct PanoramaOptions {
  int rows = 64;
  int columns = 512;  ///< a multiple of 16
  /// Degrees above the horizon of the camera: edges of the band. If the lens ends below the upper edge, the
  /// band of a camera moves down without changing its height.
  double least_elevation_deg = -12.0, most_elevation_deg = 2.5;
  int max_samples =
      4;  ///< pixels that are averaged per cell along one axis, at most; fewer where they suffice
  /// Degrees, pairs [begin, end): bearings that the own body hides, counter-clockwise from begin to end.
  std::vector<double> hidden_deg;
  /// Keys: rows, columns, least_elevation_deg, most_elevation_deg, max_samples, hidden_deg.
  static PanoramaOptions read(const options::Section& section);
};

/// The image of a catadioptric camera that looks at its mirror along the vertical, without calibration: the
/// panorama is the ring between two circles, evenly divided.
struct Ring {
  Eigen::Vector2d centre_px = Eigen::Vector2d::Zero();
  double inner_radius_px = 0.0, outer_radius_px = 0.0;
  double ahead_deg = 0.0;  ///< degrees from the image's u axis towards its v axis: direction of bearing 0
  bool counter_clockwise = false;  ///< in the image as displayed; true: bearings grow counter-clockwise there
  bool sky_outside = true;         ///< true: the outer circle is the upper edge of the panorama
};

/// Unwraps omnidirectional images to panoramas by a table that is built once. Column c of a panorama shows
/// the bearing 2πc/columns of base_link (0: x axis, counter-clockwise, as the bearings of scans). Row 0 is
/// the most elevated one. A cell is the mean of the pixels below it. Directions, not positions, are mapped:
/// the panorama is seen from the camera's optical centre.
class Unwrapper {
 public:
  /// Any lens, mounted in any orientation. Throws options::Error if no cell of the band is in the image.
  static Unwrapper fromCamera(const lens::Camera& camera, const PanoramaOptions& options);
  /// Throws options::Error for impossible radii. The elevations of the options are reported, not used.
  static Unwrapper fromRing(const cv::Size& image, const Ring& ring, const PanoramaOptions& options);
  /// An upright image of the whole sphere (width = 2·height): its middle column is bearing 0, bearings grow
  /// to the left, its middle row is the horizon.
  static Unwrapper fromEquirectangular(const cv::Size& image, const PanoramaOptions& options);

  /// @param image CV_8UC1 or CV_8UC3 (BGR) of the size that the table was built for; throws
  /// std::invalid_argument otherwise @param panorama rows × columns grey levels; allocated on the first call
  /// only. Cells outside of the image are interpolated along their row; rows without any valid cell are 0.
  void unwrap(const cv::Mat& image, cv::Mat1b& panorama) const;

  /// rows × columns, 255 where the panorama shows the image, 0 where it is interpolated.
  const cv::Mat1b& valid() const { return valid_; }
  cv::Size imageSize() const { return image_; }
  double leastElevation_rad() const { return least_rad_; }
  double mostElevation_rad() const { return most_rad_; }
  /// "equidistant 1280x960": projection and size of the image.
  const std::string& camera() const { return camera_; }

 private:
  struct Gap {
    int row, begin, count;  ///< begin in 0 … columns − 1; may wrap around
  };
  template <typename PixelOf>
  static Unwrapper build(const cv::Size& image, const PanoramaOptions& options, double least_rad,
                         double most_rad, std::string camera, const PixelOf& pixelOf);
  void hide(const std::vector<double>& hidden_deg);
  void findGaps();
  void fillGaps(cv::Mat1b& panorama) const;

  cv::Size image_;
  std::string camera_;
  double least_rad_ = 0.0, most_rad_ = 0.0;
  int samples_per_cell_ = 1;
  std::vector<PixelSample> samples_;  ///< per cell, in the order of averagePixels()
  cv::Mat1b valid_;
  std::vector<Gap> gaps_;
};

}  // namespace omnifleet::appearance
