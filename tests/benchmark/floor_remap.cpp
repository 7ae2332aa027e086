#include "tests/benchmark/floor_remap.h"

#include <opencv2/imgproc.hpp>

namespace omnifleet::bench {
namespace {

constexpr int kWidth = 1280, kHeight = 960;  // as many pixels as the frame
constexpr double kSeedInner_m = 0.30, kSeedOuter_m = 0.45;
const cv::Scalar kOutside(255, 0, 255);

bool inImage(const Eigen::Vector2d& pixel, const lens::CameraModel& model) {
  return (pixel - model.principal_point_px).norm() > model.self_mask_radius_px + 2 && pixel.x() >= 0 &&
         pixel.y() >= 0 && pixel.x() <= model.image_width_px - 1 && pixel.y() <= model.image_height_px - 1;
}

}  // namespace

FloorRemap::FloorRemap(const lens::Camera& camera)
    : foot_m_(camera.foot()), seen_(kHeight, kWidth, uchar(0)), seed_(kHeight, kWidth, uchar(0)) {
  cv::Mat2f map(kHeight, kWidth, cv::Vec2f(-1.0f, -1.0f));
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Eigen::Vector2d floor = floorFromPlan({x, y});
      const auto pixel = camera.pixelFromPoint({floor.x(), floor.y(), 0.0});
      if (!pixel || !inImage(*pixel, camera.model())) continue;
      map(y, x) = cv::Vec2f(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()));
      seen_(y, x) = 255;
      const double distance_m = (floor - foot_m_).norm();
      if (distance_m > kSeedInner_m && distance_m < kSeedOuter_m) seed_(y, x) = 255;
    }
  }
  cv::convertMaps(map, cv::noArray(), map_, map_fraction_, CV_16SC2);
}

void FloorRemap::apply(const cv::Mat3b& frame, cv::Mat3b& plan) const {
  cv::remap(frame, plan, map_, map_fraction_, cv::INTER_LINEAR, cv::BORDER_CONSTANT, kOutside);
}

Eigen::Vector2d FloorRemap::planFromFloor(const Eigen::Vector2d& point_m) const {
  const Eigen::Vector2d from_foot = (point_m - foot_m_) / kMetresPerPixel;
  return {(kWidth - 1) / 2.0 - from_foot.y(), (kHeight - 1) / 2.0 - from_foot.x()};
}

Eigen::Vector2d FloorRemap::floorFromPlan(const Eigen::Vector2d& pixel) const {
  return foot_m_ +
         kMetresPerPixel * Eigen::Vector2d((kHeight - 1) / 2.0 - pixel.y(), (kWidth - 1) / 2.0 - pixel.x());
}

}  // namespace omnifleet::bench
