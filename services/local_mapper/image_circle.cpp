#include "local_mapper/image_circle.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/imgproc.hpp>

namespace omnifleet::local_mapper {
namespace {

constexpr int kDirections = 180;
constexpr int kSide_px = 3;          // averaged on each side of the edge, at least
constexpr double kSideShare = 0.02;  // of a ray, averaged on each side: the light of a lamp ends more softly
constexpr int kBorder_px = 4;        // an edge nearer to the border of the image is the border's
constexpr std::size_t kFewest = 8;   // points of a circle
constexpr double kMadToSigma = 1.4826;
constexpr double kGate = 2.5;            // σ
constexpr double kLeastSigma_px = 0.41;  // √(2/12): a ray and its edge are rounded to pixels

double median(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
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

/// Distance along the ray of the outermost edge from dark (outside) to lit (inside). Empty: the ray is lit up
/// to the border, dark everywhere, or becomes dark without an edge.
std::optional<double> edgeDistance(const std::vector<double>& levels, const ImageCircleOptions& options) {
  const int size = static_cast<int>(levels.size());
  const int side = std::max(kSide_px, static_cast<int>(std::lround(kSideShare * size)));
  const auto lit =
      std::find_if(levels.rbegin(), levels.rend(), [&](double level) { return level > options.dark_level; });
  const int dark = static_cast<int>(lit - levels.rbegin()), r = size - 1 - dark;
  if (dark < kBorder_px || r < side) return std::nullopt;
  const auto edge = levels.begin() + r + 1;  // the first dark pixel
  const int outer = std::min(side, dark);
  const double inside = std::accumulate(edge - side, edge, 0.0) / side;
  const double outside = std::accumulate(edge, edge + outer, 0.0) / outer;
  if (inside - outside < options.least_contrast) return std::nullopt;
  return r + 0.5;
}

std::optional<ImageCircle> circleThrough(const Eigen::Vector2d& a, const Eigen::Vector2d& b,
                                         const Eigen::Vector2d& c) {
  Eigen::Matrix2d chords;
  chords << (b - a).transpose(), (c - a).transpose();
  const double area = chords.determinant();
  if (std::abs(area) < 1e-6 * chords.squaredNorm()) return std::nullopt;
  ImageCircle circle;
  circle.centre_px =
      a + chords.inverse() * (0.5 * Eigen::Vector2d((b - a).squaredNorm(), (c - a).squaredNorm()));
  circle.radius_px = (a - circle.centre_px).norm();
  return circle;
}

std::vector<double> distances(const std::vector<Eigen::Vector2d>& points, const ImageCircle& circle) {
  std::vector<double> result;
  result.reserve(points.size());
  for (const Eigen::Vector2d& point : points)
    result.push_back(std::abs((point - circle.centre_px).norm() - circle.radius_px));
  return result;
}

/// σ of the points about a circle, robust against up to half of them.
double spreadAbout(const std::vector<Eigen::Vector2d>& points, const ImageCircle& circle) {
  return std::max(kLeastSigma_px, kMadToSigma * median(distances(points, circle)));
}

/// Points are in the order of their directions, so triples with equal steps span the arc.
std::optional<ImageCircle> leastMedianCircle(const std::vector<Eigen::Vector2d>& points) {
  std::optional<ImageCircle> best;
  double least = 0.0;
  const std::size_t n = points.size();
  for (const std::size_t step : {n / 3, n / 4, n / 6}) {
    for (std::size_t i = 0; i < n; ++i) {
      const auto circle = circleThrough(points[i], points[(i + step) % n], points[(i + 2 * step) % n]);
      if (!circle) continue;
      const double spread = median(distances(points, *circle));
      if (best && spread >= least) continue;
      least = spread;
      best = circle;
    }
  }
  return best;
}

/// One Gauss–Newton step over the points within the gate. @return how many they are; 0: not determined
std::size_t refine(const std::vector<Eigen::Vector2d>& points, double sigma_px, ImageCircle& circle) {
  Eigen::Matrix3d normal = Eigen::Matrix3d::Zero();
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  double squares = 0.0;
  std::size_t used = 0;
  for (const Eigen::Vector2d& point : points) {
    const Eigen::Vector2d from = point - circle.centre_px;
    const double residual = from.norm() - circle.radius_px;
    if (std::abs(residual) > kGate * sigma_px || from.norm() < 1.0) continue;
    const Eigen::Vector3d slope(from.x() / from.norm(), from.y() / from.norm(), 1.0);
    normal += slope * slope.transpose();
    right += residual * slope;
    squares += residual * residual;
    ++used;
  }
  if (used < kFewest) return 0;
  const Eigen::Matrix3d inverse = normal.inverse();
  if (!inverse.allFinite()) return 0;
  const Eigen::Vector3d change = inverse * right;
  circle.centre_px += change.head<2>();
  circle.radius_px += change.z();
  const double sigma = std::max(kLeastSigma_px, std::sqrt(squares / static_cast<double>(used - 3)));
  const double half_trace = 0.5 * (inverse(0, 0) + inverse(1, 1));
  const double root = std::hypot(0.5 * (inverse(0, 0) - inverse(1, 1)), inverse(0, 1));
  circle.centre_sigma_px = sigma * std::sqrt(half_trace + root);
  circle.radius_sigma_px = sigma * std::sqrt(inverse(2, 2));
  return used;
}

}  // namespace

ImageCircleOptions ImageCircleOptions::read(const options::Section& section) {
  ImageCircleOptions o;
  section.read("frames", o.frames, {0, 1000});
  section.read("least_share", o.least_share, {0.05, 1.0});
  section.read("least_radius", o.least_radius, {0.0, 2.0});
  section.read("most_spread", o.most_spread, {0.0, 0.5});
  section.read("least_contrast", o.least_contrast, {1.0, 255.0});
  section.read("dark_level", o.dark_level, {0.0, 255.0});
  section.read("tolerance", o.tolerance, {0.0, 1.0});
  section.read("centre_tolerance", o.centre_tolerance, {0.0, 2.0});
  section.read("widest_view_deg", o.widest_view_deg, {180.0, 360.0});
  section.read("narrowest_view_deg", o.narrowest_view_deg, {0.0, 180.0});
  section.finish();
  return o;
}

std::optional<ImageCircle> fitCircle(const std::vector<Eigen::Vector2d>& points_px) {
  if (points_px.size() < kFewest) return std::nullopt;
  std::optional<ImageCircle> circle = leastMedianCircle(points_px);
  if (!circle) return std::nullopt;
  constexpr int kSteps = 10;
  std::size_t used = 0;
  for (int i = 0; i < kSteps; ++i) {
    used = refine(points_px, spreadAbout(points_px, *circle), *circle);
    if (used == 0) return std::nullopt;
  }
  circle->sigma_px = spreadAbout(points_px, *circle);
  circle->share = static_cast<double>(used) / static_cast<double>(points_px.size());
  return circle;
}

std::optional<ImageCircle> findImageCircle(const cv::Mat& image, const ImageCircleOptions& options) {
  cv::Mat grey = image;
  if (image.channels() == 3) cv::cvtColor(image, grey, cv::COLOR_BGR2GRAY);
  // On a pixel: rays in opposite directions are rounded alike.
  const Eigen::Vector2d middle_px(grey.cols / 2, grey.rows / 2);
  std::vector<Eigen::Vector2d> edges_px;
  for (int i = 0; i < kDirections; ++i) {
    const double angle = 2.0 * M_PI * i / kDirections;
    const Eigen::Vector2d step(std::cos(angle), std::sin(angle));
    if (const auto distance = edgeDistance(profile(grey, middle_px, step), options))
      edges_px.emplace_back(middle_px + *distance * step);
  }
  std::optional<ImageCircle> circle = fitCircle(edges_px);
  if (!circle) return std::nullopt;
  circle->share *= static_cast<double>(edges_px.size()) / kDirections;
  const double half_side_px = 0.5 * std::min(grey.cols, grey.rows);
  if (circle->share < options.least_share || circle->sigma_px > options.most_spread * circle->radius_px ||
      circle->radius_px < options.least_radius * half_side_px)
    return std::nullopt;
  return circle;
}

}  // namespace omnifleet::local_mapper
