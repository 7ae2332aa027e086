#include "local_mapper/image_circle.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <vector>

namespace omnifleet::local_mapper {
namespace {

constexpr int kDirections = 180;
constexpr int kSide_px = 3;    // averaged on each side of the edge
constexpr int kBorder_px = 4;  // an edge nearer to the border of the image is the border's
constexpr double kMadToSigma = 1.4826;

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Eigen::Vector2d direction(int index) {
  const double angle = 2.0 * M_PI * index / kDirections;
  return {std::cos(angle), std::sin(angle)};
}

/// Grey levels along a ray, one per pixel, until the border of the image.
std::vector<double> profile(const cv::Mat& grey, const Eigen::Vector2d& centre_px,
                            const Eigen::Vector2d& step) {
  std::vector<double> levels;
  for (int r = 0;; ++r) {
    const Eigen::Vector2d at = centre_px + r * step;
    const int x = static_cast<int>(std::lround(at.x())), y = static_cast<int>(std::lround(at.y()));
    if (x < 0 || y < 0 || x >= grey.cols || y >= grey.rows) return levels;
    levels.push_back(grey.at<unsigned char>(y, x));
  }
}

/// Radius of the outermost edge from dark (outside) to lit (inside); empty: the ray is lit up to the border,
/// or dark everywhere.
std::optional<double> edgeRadius(const std::vector<double>& levels, const ImageCircleOptions& options) {
  const int size = static_cast<int>(levels.size());
  double outside = 0.0;
  for (int r = size - 1; r >= kSide_px; --r) {
    if (levels[static_cast<std::size_t>(r)] > options.dark_level) {
      // The first lit pixel from outside: the edge, if it is lit well inside.
      double inside = 0.0;
      for (int k = 0; k < kSide_px; ++k) inside += levels[static_cast<std::size_t>(r - k)] / kSide_px;
      const int dark = size - 1 - r;
      if (dark < kBorder_px || inside - outside / dark < options.least_contrast) return std::nullopt;
      return r + 0.5;
    }
    outside += levels[static_cast<std::size_t>(r)];
  }
  return std::nullopt;
}

/// Radius at which the field of view of the model ends in a direction of the image; empty: outside the image,
/// or no lens of a round image.
std::optional<double> modelRadius(const lens::Camera& camera, const Eigen::Vector2d& step,
                                  double longest_px) {
  const Eigen::Vector2d centre_px = camera.model().principal_point_px;
  if (!camera.lens().rayFromPixel(centre_px)) return std::nullopt;
  double inside = 0.0, outside = longest_px;
  if (camera.lens().rayFromPixel(centre_px + outside * step)) return std::nullopt;
  while (outside - inside > 0.1) {
    const double middle = 0.5 * (inside + outside);
    (camera.lens().rayFromPixel(centre_px + middle * step) ? inside : outside) = middle;
  }
  return inside;
}

}  // namespace

ImageCircleOptions ImageCircleOptions::read(const options::Section& section) {
  ImageCircleOptions o;
  section.read("least_share", o.least_share, {0.05, 1.0});
  section.read("most_spread", o.most_spread, {0.0, 0.5});
  section.read("least_contrast", o.least_contrast, {1.0, 255.0});
  section.read("dark_level", o.dark_level, {0.0, 255.0});
  section.read("tolerance", o.tolerance, {0.0, 1.0});
  section.read("frames", o.frames, {0, 1000});
  section.finish();
  return o;
}

std::optional<ImageCircle> findImageCircle(const cv::Mat& image, const Eigen::Vector2d& centre_px,
                                           const ImageCircleOptions& options) {
  cv::Mat grey = image;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  std::vector<double> radii;
  for (int i = 0; i < kDirections; ++i) {
    if (const auto radius = edgeRadius(profile(grey, centre_px, direction(i)), options))
      radii.push_back(*radius);
  }
  const double share = static_cast<double>(radii.size()) / kDirections;
  if (share < options.least_share) return std::nullopt;
  const double radius = median(radii);
  std::vector<double> deviations;
  for (const double r : radii) deviations.push_back(std::abs(r - radius));
  const double sigma = kMadToSigma * median(deviations);
  if (sigma > options.most_spread * radius) return std::nullopt;
  return ImageCircle{radius, sigma, share};
}

std::optional<LensVerdict> contradiction(const cv::Mat& image, const lens::CameraModel& model,
                                         const ImageCircleOptions& options) {
  const auto seen = findImageCircle(image, model.principal_point_px, options);
  if (!seen) return std::nullopt;
  const lens::Camera camera(model);
  const double longest_px = std::hypot(model.image_width_px, model.image_height_px);
  std::vector<double> radii;
  for (int i = 0; i < kDirections; ++i) {
    if (const auto radius = modelRadius(camera, direction(i), longest_px)) radii.push_back(*radius);
  }
  LensVerdict verdict{*seen, 2 * static_cast<int>(radii.size()) > kDirections ? median(radii) : 0.0};
  if (verdict.model_px > 0.0 && seen->radius_px > (1.0 - options.tolerance) * verdict.model_px)
    return std::nullopt;
  return verdict;
}

}  // namespace omnifleet::local_mapper
