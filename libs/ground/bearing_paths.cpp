#include "ground/bearing_paths.h"

#include <algorithm>
#include <cmath>
#include <functional>

#include "options/options.h"

namespace omnifleet::ground {
namespace {

cv::Vec3f bilinear(const cv::Mat& image, const cv::Point2f& at) {
  const int x = std::clamp(static_cast<int>(at.x), 0, image.cols - 2),
            y = std::clamp(static_cast<int>(at.y), 0, image.rows - 2);
  const float a = at.x - static_cast<float>(x), b = at.y - static_cast<float>(y);
  const int channels = image.channels();
  const std::uint8_t* p = image.ptr(y) + x * channels;
  const std::uint8_t* q = image.ptr(y + 1) + x * channels;
  cv::Vec3f colour;
  for (int c = 0; c < 3; ++c) {
    const int k = channels == 3 ? c : 0;
    colour[c] = (1 - b) * ((1 - a) * p[k] + a * p[k + channels]) + b * ((1 - a) * q[k] + a * q[k + channels]);
  }
  return colour;
}

}  // namespace

BearingPaths::BearingPaths(const lens::Camera& camera, const FloorView& view, int bearings, double end_rad) {
  constexpr double kStep_rad = 2e-4;
  const cv::Rect inside(2, 2, view.imageSize().width - 4, view.imageSize().height - 4);
  for (int i = 0; i < bearings; ++i) {
    const double bearing = 2.0 * M_PI * i / bearings;
    const Eigen::Vector2d along(std::cos(bearing), std::sin(bearing));
    Path path;
    path.begin = static_cast<int>(pixel_.size());
    cv::Point2f last;
    double since_px = 0.0;
    for (double angle = 0.02; angle < end_rad; angle += kStep_rad) {
      const double range_m = camera.height() * std::tan(angle);
      const Eigen::Vector2d floor = camera.foot() + range_m * along;
      const auto pixel = camera.pixelFromPoint({floor.x(), floor.y(), 0.0});
      const cv::Point2f at = pixel
                                 ? cv::Point2f(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()))
                                 : cv::Point2f(-1, -1);
      const cv::Point nearest(cvRound(at.x), cvRound(at.y));
      const bool seen = pixel && inside.contains(nearest) && view.mask()(nearest) != 0;
      if (!seen && path.count == 0) continue;  // the own body
      if (!seen) break;
      if (path.count > 0) {
        since_px += std::hypot(at.x - last.x, at.y - last.y);
        last = at;
        if (since_px < 1.0) continue;
        since_px -= 1.0;
      }
      last = at;
      pixel_.push_back(at);
      nearest_.push_back(nearest);
      inverse_.push_back(static_cast<float>(1.0 / range_m));
      ++path.count;
    }
    paths_.push_back(path);
  }
  if (pixel_.empty()) throw options::Error("no bearing shows floor: check fov_deg and self_mask_radius_px");
}

float BearingPaths::inverseAt(const Path& path, double at) const {
  const auto k = static_cast<std::size_t>(path.begin + static_cast<int>(at));
  const auto f = static_cast<float>(at - std::floor(at));
  return (1 - f) * inverse_[k] + f * inverse_[k + 1];
}

float BearingPaths::slopeAt(const Path& path, double at) const {
  const auto k = static_cast<std::size_t>(path.begin + static_cast<int>(at));
  return inverse_[k + 1] - inverse_[k];
}

double BearingPaths::placeOf(const Path& path, float inverse_m) const {
  const auto begin = inverse_.begin() + path.begin, end = begin + path.count;
  const auto after = std::lower_bound(begin, end, inverse_m, std::greater<float>());
  if (after == begin) return 0.0;
  if (after == end) return path.count - 1;
  const float before = *(after - 1);
  return static_cast<double>(after - begin - 1) + (before - inverse_m) / (before - *after);
}

cv::Vec3f BearingPaths::colour(const cv::Mat& image, const Path& path, double at) const {
  at = std::clamp(at, 0.0, path.count - 1.001);
  const auto k = static_cast<std::size_t>(path.begin + static_cast<int>(at));
  const auto f = static_cast<float>(at - std::floor(at));
  return bilinear(image, pixel_[k] * (1 - f) + pixel_[k + 1] * f);
}

}  // namespace omnifleet::ground
