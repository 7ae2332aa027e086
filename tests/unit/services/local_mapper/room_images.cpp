#include "tests/unit/services/local_mapper/room_images.h"

#include <cmath>
#include <vector>

namespace omnifleet::test {
namespace {

constexpr int kSide_px = 480;
constexpr double kLeastElevation_rad = -16.0 * M_PI / 180.0, kMostElevation_rad = 4.5 * M_PI / 180.0;

struct RoomRay {
  int row, column;
  double bearing_rad, elevation_rad;
};

std::vector<RoomRay> raysOf(const lens::Camera& camera) {
  std::vector<RoomRay> rays;
  for (int k = 0; k < 4 * kSide_px * kSide_px; ++k) {
    const int pixel = k / 4, row = pixel / kSide_px, column = pixel % kSide_px;
    const auto ray = camera.rayFromPixel({column + 0.5 * (k % 2) - 0.25, row + 0.5 * (k / 2 % 2) - 0.25});
    if (!ray) continue;
    const double elevation = std::asin(ray->z());
    if (elevation > kLeastElevation_rad && elevation < kMostElevation_rad)
      rays.push_back({row, column, std::atan2(ray->y(), ray->x()), elevation});
  }
  return rays;
}

}  // namespace

lens::CameraModel roomCamera() {
  lens::CameraModel model;
  model.image_width_px = model.image_height_px = kSide_px;
  model.principal_point_px = Eigen::Vector2d::Constant(0.5 * (kSide_px - 1));
  model.fov_deg = 190.0;
  model.focal_px = Eigen::Vector2d::Constant(235.0 / (95.0 * M_PI / 180.0));
  model.position_m = {0.0, 0.0, 0.5};
  return model;
}

cv::Mat1b roomImage(const TexturedRoom& room, const Pose2& map_from_base) {
  static const std::vector<RoomRay> kRays = raysOf(lens::Camera(roomCamera()));
  cv::Mat1d sum(kSide_px, kSide_px, 0.0);
  cv::Mat1i count(kSide_px, kSide_px, 0);
  for (const RoomRay& ray : kRays) {
    sum(ray.row, ray.column) += room.grey(map_from_base, 0.5, ray.bearing_rad, ray.elevation_rad);
    ++count(ray.row, ray.column);
  }
  cv::Mat1b image(kSide_px, kSide_px, std::uint8_t{110});
  for (int row = 0; row < kSide_px; ++row) {
    for (int column = 0; column < kSide_px; ++column) {
      if (count(row, column) > 0)
        image(row, column) = static_cast<std::uint8_t>(std::lround(sum(row, column) / count(row, column)));
    }
  }
  return image;
}

DirectTransform transformRows(const cv::Mat1b& panorama, int rows, int frequencies) {
  const int columns = panorama.cols, averaged = panorama.rows / rows;
  DirectTransform result{cv::Mat1d(rows, frequencies), cv::Mat1d(rows, frequencies)};
  for (int row = 0; row < rows; ++row) {
    std::vector<double> mean(static_cast<std::size_t>(columns), 0.0);
    for (int c = 0; c < columns; ++c) {
      for (int k = 0; k < averaged; ++k)
        mean[static_cast<std::size_t>(c)] += panorama(row * averaged + k, c) / double(averaged);
    }
    for (int k = 1; k <= frequencies; ++k) {
      double real = 0.0, imaginary = 0.0;
      for (int c = 0; c < columns; ++c) {
        const double angle = -2.0 * M_PI * (k * c % columns) / columns;
        real += mean[static_cast<std::size_t>(c)] * std::cos(angle) / columns;
        imaginary += mean[static_cast<std::size_t>(c)] * std::sin(angle) / columns;
      }
      result.modules(row, k - 1) = std::hypot(real, imaginary);
      result.phases(row, k - 1) = std::atan2(imaginary, real);
    }
  }
  return result;
}

double directDifference(const cv::Mat1b& a, const cv::Mat1b& b) {
  const cv::Mat1d of_a = transformRows(a, 16, 128).modules, of_b = transformRows(b, 16, 128).modules;
  return cv::norm(of_a, of_b) / (0.5 * (cv::norm(of_a) + cv::norm(of_b)));
}

}  // namespace omnifleet::test
