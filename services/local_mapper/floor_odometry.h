#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <string>

#include "ground/floor_alignment.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::local_mapper {

struct FloorOdometryOptions {
  /// `auto`: for robots without wheels; `always`; `never`. It costs .8 ms per frame at 1280 × 960.
  std::string use = "auto";
  bool is_optional = false;  ///< a camera that does not see the annulus is no error
  ground::FloorAlignmentOptions alignment;
  static FloorOdometryOptions read(const options::Section& section);
  bool isUsed(bool has_wheels) const { return use == "always" || (use == "auto" && !has_wheels); }
};

/// Motion of the robot from frame to frame by the texture of the floor (ground::FloorAlignment). Both frames
/// are aligned with one reference, whose noise they share. So the covariance of a step is the mean of both.
class FloorOdometry {
 public:
  /// Throws options::Error if no cell of the annulus shows floor.
  FloorOdometry(const lens::Camera& camera, const ground::FloorView& view,
                const ground::FloorAlignmentOptions& options)
      : alignment_(camera, view, options) {}

  /// @param image CV_8UC1, or CV_8UC3 (BGR) @param objects not 0 where a pixel is not floor
  /// @param wheels motion since the previous frame, used as prediction if it is valid
  FloorMotion add(TimeNs time, const cv::Mat& image, const cv::Mat1b& objects, const Motion& wheels);
  /// Frames before do not lead to the next one: a gap, or an image that shows no floor.
  void forget();

 private:
  struct Aligned {
    TimeNs reference_ns = 0;
    Pose2 reference_from_base;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< right perturbation
  };
  ground::FloorAlignment alignment_;
  std::optional<TimeNs> previous_ns_;
  std::optional<Aligned> previous_;  ///< the previous frame, if it was aligned
};

}  // namespace omnifleet::local_mapper
