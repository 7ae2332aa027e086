#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>

#include "lens/camera.h"
#include "local_mapper/image_circle.h"

namespace omnifleet::local_mapper {

/// How the round edge of the image contradicts the lens of sensor.yaml.
enum class Contradiction {
  kNone,
  kNoEdge,    ///< the model is a pinhole or equirectangular camera, whose image has no round edge
  kCentre,    ///< the circle's centre is not the principal point
  kStated,    ///< the image ends inside the field of view that fov_deg states
  kTooWide,   ///< no lens has the view that the model gives at the edge, and fov_deg does not state it
  kTooNarrow  ///< a lens of this view has no round image, and fov_deg does not state it
};

/// What the edge of the image says about the lens of sensor.yaml.
struct LensVerdict {
  Contradiction contradiction = Contradiction::kNone;
  ImageCircle circle;
  double centre_off_px = 0.0;  ///< between the circle's centre and the principal point
  double view_deg = 0.0;       ///< full angle at which the image ends by the model; 0 for kNoEdge
  bool states_view = false;    ///< fov_deg is less than what projection and image size allow
  double stated_px = 0.0;      ///< radius at which the stated fov_deg ends; 0: none, or outside the image
};

/// Compares the circle with the model. A fov_deg that is exactly the widest that projection and image size
/// allow is what CameraModel::read assumes when no file states one. It says nothing about the image's edge. A
/// stated fov_deg may be less than the lens shows, never more.
LensVerdict judgeLens(const ImageCircle& circle, const lens::CameraModel& model,
                      const ImageCircleOptions& options);

/// Full angle (degrees) of the model at the circle: twice the median angle to the axis. Where the model has
/// no rays beyond an angle, it is continued as an equidistant lens of the same focal length: few real lenses
/// are compressed less at their rim.
double viewAtCircle(const ImageCircle& circle, const lens::CameraModel& model);

/// Examines the first frames of a camera, until one shows the edge of the image.
class LensCheck {
 public:
  LensCheck(const lens::CameraModel& model, const ImageCircleOptions& options)
      : model_(model), options_(options) {}

  /// The verdict, once: for the first frame that shows the edge.
  /// @param image BGR8 or grey; ignored if it has another size than the model
  std::optional<LensVerdict> examine(const cv::Mat& image);

 private:
  lens::CameraModel model_;
  ImageCircleOptions options_;
  int frames_ = 0;  ///< examined
};

}  // namespace omnifleet::local_mapper
