#include "localizer/ceiling_view.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::localizer {
namespace {

constexpr int kShift = 4;  // sub-pixel bits of OpenCV's drawing functions

using Pixels = std::vector<cv::Point>;

/// Pixels of points at a height of the map; empty if the camera does not show one of them.
Pixels project(const lens::Camera& camera, const std::vector<Eigen::Vector2d>& points_m, double height_m) {
  Pixels pixels;
  for (const Eigen::Vector2d& p : points_m) {
    const auto pixel = camera.pixelFromPoint({p.x(), p.y(), height_m});
    if (!pixel) return {};
    pixels.emplace_back(cvRound(pixel->x() * (1 << kShift)), cvRound(pixel->y() * (1 << kShift)));
  }
  return pixels;
}

void drawLine(const Pixels& pixels, bool closed, const cv::Scalar& colour, cv::Mat& image) {
  if (pixels.empty()) return;
  cv::polylines(image, std::vector<Pixels>{pixels}, closed, colour, 1, cv::LINE_AA, kShift);
}

struct Rectangle {
  Eigen::Vector2d centre_m, size_m;
};

std::vector<Rectangle> rectanglesOf(const dataset::MarkerSet& markers) {
  if (markers.kind == dataset::MarkerKind::kPatches)
    return {{markers.team_offset_m, markers.patch_size_m},
            {markers.individual_offset_m, markers.patch_size_m}};
  return {{Eigen::Vector2d::Zero(), markers.cover_size_m},
          {markers.tail_offset_m, markers.tail_size_m},
          {markers.head_offset_m, markers.head_size_m}};
}

}  // namespace

void drawTracking(const lens::Camera& camera, const dataset::MarkerSet& markers,
                  const std::vector<ViewedRobot>& robots, cv::Mat& image) {
  constexpr double kHeading_m = 0.25, kView_m = 0.6;
  const cv::Scalar black(0, 0, 0), white(255, 255, 255), red(0, 0, 255), yellow(0, 255, 255);
  for (const ViewedRobot& robot : robots) {
    const auto toMap = [&](const std::vector<Eigen::Vector2d>& in_base) {
      std::vector<Eigen::Vector2d> points_m;
      for (const Eigen::Vector2d& p : in_base) points_m.push_back(robot.map_from_base * p);
      return points_m;
    };
    for (const Rectangle& r : rectanglesOf(markers)) {
      const Eigen::Vector2d half = 0.5 * r.size_m, other(half.x(), -half.y());
      drawLine(project(camera,
                       toMap({r.centre_m - half, r.centre_m + other, r.centre_m + half, r.centre_m - other}),
                       markers.height_m),
               true, black, image);
    }
    const auto ray = [&](double bearing_rad, double length_m) {
      return toMap({{0.0, 0.0}, length_m * Eigen::Vector2d(std::cos(bearing_rad), std::sin(bearing_rad))});
    };
    if (robot.half_view_rad) {
      drawLine(project(camera, ray(*robot.half_view_rad, kView_m), 0.0), false, red, image);
      drawLine(project(camera, ray(-*robot.half_view_rad, kView_m), 0.0), false, yellow, image);
    }
    const Pixels heading = project(camera, ray(0.0, kHeading_m), markers.height_m);
    drawLine(heading, false, white, image);
    if (heading.empty()) continue;
    const cv::Point at(heading[0].x / (1 << kShift) + 8, heading[0].y / (1 << kShift) - 8);
    cv::putText(image, robot.name, at, cv::FONT_HERSHEY_SIMPLEX, 0.45, black, 3, cv::LINE_AA);
    cv::putText(image, robot.name, at, cv::FONT_HERSHEY_SIMPLEX, 0.45, white, 1, cv::LINE_AA);
  }
}

void drawMap(const lens::Camera& camera, const dataset::OccupancyGrid& grid, cv::Mat& image) {
  constexpr std::int8_t kFree = 0, kOccupied = 100;
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const auto floor = camera.floorFromPixel({u, v});
      if (!floor) continue;
      const Eigen::Vector2d cell = (*floor - grid.origin_m) / grid.resolution_m;
      const double x = std::floor(cell.x()), y = std::floor(cell.y());
      if (!(x >= 0 && y >= 0 && x < grid.width && y < grid.height)) continue;
      const std::int8_t value =
          grid.cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid.width) +
                     static_cast<std::size_t>(x)];
      auto& pixel = image.at<cv::Vec3b>(v, u);
      if (value == kOccupied) pixel = {255, 255, 255};
      if (value == kFree) pixel = cv::Vec3b(0.7 * cv::Vec3d(pixel) + 0.3 * cv::Vec3d(120, 190, 90));
    }
  }
}

}  // namespace omnifleet::localizer
