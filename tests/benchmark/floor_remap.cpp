#include "tests/benchmark/floor_remap.h"

#include <opencv2/imgproc.hpp>

namespace omnifleet::bench {
namespace {

constexpr double kSeedInner_m = 0.30, kSeedOuter_m = 0.45;
const cv::Scalar kOutside(255, 0, 255);

bool inImage(const Eigen::Vector2d& pixel, const lens::CameraModel& model) {
  return (pixel - model.principal_point_px).norm() > model.self_mask_radius_px + 2 && pixel.x() >= 0 &&
         pixel.y() >= 0 && pixel.x() <= model.image_width_px - 1 && pixel.y() <= model.image_height_px - 1;
}

}  // namespace

FloorRemap::FloorRemap(const lens::Camera& camera, const cv::Size& plan_px)
    : foot_m_(camera.foot()),
      middle_px_((plan_px.width - 1) / 2.0, (plan_px.height - 1) / 2.0),
      seen_(plan_px, uchar(0)),
      seed_(plan_px, uchar(0)) {
  cv::Mat2f map(plan_px, cv::Vec2f(-1.0f, -1.0f));
  for (int y = 0; y < map.rows; ++y) {
    for (int x = 0; x < map.cols; ++x) {
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
  return middle_px_ - Eigen::Vector2d(from_foot.y(), from_foot.x());
}

Eigen::Vector2d FloorRemap::floorFromPlan(const Eigen::Vector2d& pixel) const {
  const Eigen::Vector2d from_middle = middle_px_ - pixel;
  return foot_m_ + kMetresPerPixel * Eigen::Vector2d(from_middle.y(), from_middle.x());
}

}  // namespace omnifleet::bench
