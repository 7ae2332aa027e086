#include "ground/floor_boundary.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace omnifleet::ground {
namespace {

constexpr int kReach_px = 10;  // of the profile to both sides of the edge
constexpr int kPerPixel = 2;   // samples of the profile
constexpr int kSamples = 2 * kReach_px * kPerPixel + 1;
constexpr double kWindow_px = 2.5;  // half width of the area that places the edge
constexpr double kPlateau_px = 2.0, kPlateauEnd_px = 4.0, kFar_px = 5.0, kFarEnd_px = 8.0;
constexpr int kRounds = 3;

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

/// Samples along one bearing, kReach_px to both sides of a step.
struct Profile {
  std::array<cv::Vec3f, kSamples> colour;

  /// @param from, to pixels from the middle
  cv::Vec3f mean(double from, double to) const {
    cv::Vec3f sum(0, 0, 0);
    int n = 0;
    const int first = std::max(0, static_cast<int>(std::ceil((from + kReach_px) * kPerPixel))),
              last = std::min(kSamples - 1, static_cast<int>(std::floor((to + kReach_px) * kPerPixel)));
    for (int i = first; i <= last; ++i, ++n) sum += colour[static_cast<std::size_t>(i)];
    return n > 0 ? sum * (1.0f / static_cast<float>(n)) : sum;
  }
  cv::Vec3f at(double offset_px) const {
    const double i = std::clamp((offset_px + kReach_px) * kPerPixel, 0.0, kSamples - 1.001);
    const auto k = static_cast<std::size_t>(i);
    const auto f = static_cast<float>(i - static_cast<double>(k));
    return colour[k] * (1 - f) + colour[k + 1] * f;
  }
};

}  // namespace

BoundaryOptions BoundaryOptions::read(const options::Section& section) {
  BoundaryOptions o;
  section.read("bearings", o.bearings, {360, 1440});
  section.read("max_angle_deg", o.max_angle_deg, {45.0, 89.5});
  section.read("run_px", o.run_px, {1.0, 20.0});
  section.read("min_contrast", o.min_contrast, {1.0, 255.0});
  section.read("max_shift_px", o.max_shift_px, {0.5, 6.0});
  section.read("sigma_px", o.sigma_px, {0.01, 5.0});
  section.finish();
  return o;
}

FloorBoundary::FloorBoundary(const lens::Camera& camera, const FloorView& view,
                             const BoundaryOptions& options)
    : options_(options) {
  constexpr double kStep_rad = 2e-4;
  const double end_rad = options.max_angle_deg * M_PI / 180.0;
  const cv::Rect inside(2, 2, view.imageSize().width - 4, view.imageSize().height - 4);
  for (int i = 0; i < options.bearings; ++i) {
    const double bearing = 2.0 * M_PI * i / options.bearings;
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
  boundary_.origin_m = camera.foot();
  boundary_.inverse_m.resize(paths_.size());
  boundary_.sigma.resize(paths_.size());
}

const Boundary& FloorBoundary::find(const cv::Mat& image, const cv::Mat1b& objects) {
  for (std::size_t i = 0; i < paths_.size(); ++i) {
    const Path& path = paths_[i];
    boundary_.inverse_m[i] = boundary_.sigma[i] = 0.0f;
    const int step = firstEnd(path, objects);
    double edge = step;
    if (step >= path.count || !refine(path, step, image, edge)) continue;
    const int k = path.begin + static_cast<int>(edge);
    const auto f = static_cast<float>(edge - std::floor(edge));
    const auto at = static_cast<std::size_t>(k);
    boundary_.inverse_m[i] = (1 - f) * inverse_[at] + f * inverse_[at + 1];
    boundary_.sigma[i] = static_cast<float>(options_.sigma_px) * std::abs(inverse_[at + 1] - inverse_[at]);
  }
  return boundary_;
}

int FloorBoundary::firstEnd(const Path& path, const cv::Mat1b& objects) const {
  int run = 0;
  for (int k = 0; k < path.count; ++k) {
    run = objects(nearest_[static_cast<std::size_t>(path.begin + k)]) != 0 ? run + 1 : 0;
    if (run >= options_.run_px) return k - run + 1;
  }
  return path.count;
}

/// Three rounds around the edge found so far. False where the contrast is too low or the edge is not near
/// `step`.
bool FloorBoundary::refine(const Path& path, int step, const cv::Mat& image, double& edge) {
  if (step < kReach_px / 2 || step + kReach_px / 2 >= path.count) return false;
  Profile profile;
  for (int i = 0; i < kSamples; ++i) {
    const double at =
        std::clamp(step + static_cast<double>(i) / kPerPixel - kReach_px, 0.0, path.count - 1.001);
    const auto k = static_cast<std::size_t>(path.begin + static_cast<int>(at));
    const auto f = static_cast<float>(at - std::floor(at));
    profile.colour[static_cast<std::size_t>(i)] = bilinear(image, pixel_[k] * (1 - f) + pixel_[k + 1] * f);
  }
  double shift = 0.0;
  for (int round = 0; round < kRounds; ++round) {
    const cv::Vec3f inner = profile.mean(shift - kPlateauEnd_px, shift - kPlateau_px),
                    outer = profile.mean(shift + kPlateau_px, shift + kPlateauEnd_px);
    cv::Vec3f gradient(0, 0, 0);  // of the floor, per pixel outwards
    if (step + shift - kFarEnd_px >= 0.0)
      gradient = (inner - profile.mean(shift - kFarEnd_px, shift - kFar_px)) *
                 static_cast<float>(2.0 / (kFar_px + kFarEnd_px - kPlateau_px - kPlateauEnd_px));
    const cv::Vec3f floor = inner + gradient * static_cast<float>(0.5 * (kPlateau_px + kPlateauEnd_px)),
                    contrast = outer - floor;
    const float square = contrast.dot(contrast);
    if (square < options_.min_contrast * options_.min_contrast) return false;
    double outside = 0.0;
    int n = 0;
    constexpr double kStep_px = 0.5 / kPerPixel;
    for (double d = -kWindow_px + 0.5 * kStep_px; d < kWindow_px; d += kStep_px, ++n) {
      const cv::Vec3f here = floor + gradient * static_cast<float>(std::min(d, 0.0));
      outside += std::clamp((profile.at(shift + d) - here).dot(contrast) / square, -0.5f, 1.5f);
    }
    shift += std::clamp((0.5 - outside / n) * 2.0 * kWindow_px, -1.5, 1.5);
    if (std::abs(shift) > options_.max_shift_px) return false;
  }
  edge = step + shift;
  return edge >= 1.0 && edge + 2.0 < path.count;
}

}  // namespace omnifleet::ground
