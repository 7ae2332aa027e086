#pragma once

#include <cmath>
#include <opencv2/imgproc.hpp>
#include <random>
#include <vector>

#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "lens/camera.h"

namespace omnifleet::markers {

/// Renders images with exact ground truth: polygons drawn by OpenCV with eight-fold oversampling. Each corner
/// is projected by the camera model.
class Painter {
 public:
  explicit Painter(const lens::CameraModel& model)
      : camera(model),
        large_(model.image_height_px * kFold, model.image_width_px * kFold, CV_8UC3,
               cv::Scalar(150, 160, 165)) {}

  void rectangle(const Pose2& pose, double height_m, const Eigen::Vector2d& offset,
                 const Eigen::Vector2d& size, const dataset::Rgb& rgb) {
    constexpr int kShift = 4, kSteps = 8;  // steps along each edge, so that distortion bends it
    std::vector<cv::Point> outline;
    const Eigen::Vector2d corners[] = {{-1, -1}, {1, -1}, {1, 1}, {-1, 1}};
    for (int c = 0; c < 4; ++c) {
      for (int s = 0; s < kSteps; ++s) {
        const Eigen::Vector2d u = corners[c] + (corners[(c + 1) % 4] - corners[c]) * s / kSteps;
        const Eigen::Vector2d p = pose * (offset + 0.5 * u.cwiseProduct(size));
        const auto pixel = camera.pixelFromPoint({p.x(), p.y(), height_m});
        if (!pixel) return;
        const auto fine = [](double v) {
          return static_cast<int>(std::lround(((v + 0.5) * kFold - 0.5) * (1 << kShift)));
        };
        outline.emplace_back(fine(pixel->x()), fine(pixel->y()));
      }
    }
    cv::fillPoly(large_, std::vector<std::vector<cv::Point>>{outline}, cv::Scalar(rgb[2], rgb[1], rgb[0]),
                 cv::LINE_8, kShift);
  }

  void robot(const dataset::MarkerSet& set, const std::string& name, const Pose2& pose) {
    rectangle(pose, set.height_m, {0, 0}, {0.29, 0.2}, {30, 30, 30});
    rectangle(pose, set.height_m, set.team_offset_m, set.patch_size_m, set.team);
    rectangle(pose, set.height_m, set.individual_offset_m, set.patch_size_m, set.robots.at(name).individual);
  }

  /// The image with scaled brightness and Gaussian noise.
  cv::Mat image(double gain = 1.0, double noise = 0.0) const {
    cv::Mat fine, result;
    cv::resize(large_, fine, {camera.model().image_width_px, camera.model().image_height_px}, 0, 0,
               cv::INTER_AREA);
    fine.convertTo(result, CV_16SC3, gain);
    if (noise > 0) {
      cv::Mat pixel_noise(result.size(), CV_16SC3);
      cv::RNG random(1);
      random.fill(pixel_noise, cv::RNG::NORMAL, 0, noise);
      result += pixel_noise;
    }
    result.convertTo(fine, CV_8UC3);
    return fine;
  }

  const lens::Camera camera;

 private:
  static constexpr int kFold = 8;
  cv::Mat large_;
};

inline dataset::MarkerSet patchSet() {
  dataset::MarkerSet set;
  set.height_m = 0.3;
  set.team = {20, 90, 220};
  set.team_offset_m = {-0.06, 0.0};
  set.individual_offset_m = {0.06, 0.0};
  set.patch_size_m = {0.09, 0.12};
  set.robots["r1"].individual = {230, 60, 60};
  set.robots["r2"].individual = {60, 200, 60};
  set.robots["r3"].individual = {200, 60, 200};
  return set;
}

inline lens::CameraModel ceilingCamera() {
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = 640;
  model.image_height_px = 480;
  model.focal_px = {410.0, 410.0};
  model.principal_point_px = {319.5, 239.5};
  model.position_m = {0.2, -0.1, 3.0};
  return model;
}

}  // namespace omnifleet::markers
