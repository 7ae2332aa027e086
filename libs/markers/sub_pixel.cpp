#include "markers/sub_pixel.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <vector>

namespace omnifleet::markers {
namespace {

constexpr int kReach_px = 2;  // how far beyond the mask the patch's blurred edge reaches
constexpr int kRing_px = 4;   // how far the surroundings are looked at

Eigen::Vector3d colourAt(const cv::Mat& bgr, int x, int y) {
  const std::uint8_t* p = bgr.ptr<std::uint8_t>(y) + 3 * x;
  return {1.0 * p[0], 1.0 * p[1], 1.0 * p[2]};
}

Eigen::Vector3d median(std::vector<Eigen::Vector3d>& colours) {
  Eigen::Vector3d result;
  const auto middle = colours.begin() + static_cast<std::ptrdiff_t>(colours.size() / 2);
  for (int c = 0; c < 3; ++c) {
    std::nth_element(colours.begin(), middle, colours.end(),
                     [c](const auto& a, const auto& b) { return a[c] < b[c]; });
    result[c] = (*middle)[c];
  }
  return result;
}

/// The blob's box with a margin; distance (chessboard) of every pixel to the blob's class, up to the margin.
struct Window {
  int left, top, width, height;
  std::vector<int> distance;

  int at(int x, int y) const { return distance[static_cast<std::size_t>((y - top) * width + x - left)]; }
};

Window windowOf(const cv::Mat& bgr, const ColourTable& table, const Blob& blob) {
  Window w;
  w.left = std::max(0, blob.left - kRing_px);
  w.top = std::max(0, blob.top - kRing_px);
  w.width = std::min(bgr.cols - 1, blob.right + kRing_px) - w.left + 1;
  w.height = std::min(bgr.rows - 1, blob.bottom + kRing_px) - w.top + 1;
  w.distance.assign(static_cast<std::size_t>(w.width * w.height), kRing_px + 1);
  for (int y = blob.top; y <= blob.bottom; ++y) {
    const std::uint8_t* row = bgr.ptr<std::uint8_t>(y);
    for (int x = blob.left; x <= blob.right; ++x) {
      if (table.classOf(row + 3 * x) != blob.colour) continue;
      for (int v = std::max(w.top, y - kRing_px); v <= std::min(w.top + w.height - 1, y + kRing_px); ++v) {
        for (int u = std::max(w.left, x - kRing_px); u <= std::min(w.left + w.width - 1, x + kRing_px); ++u) {
          int& d = w.distance[static_cast<std::size_t>((v - w.top) * w.width + u - w.left)];
          d = std::min(d, std::max(std::abs(u - x), std::abs(v - y)));
        }
      }
    }
  }
  return w;
}

}  // namespace

std::optional<Patch> refine(const cv::Mat& bgr, const ColourTable& table, const Blob& blob,
                            const lens::Camera& camera, double plane_height_m) {
  const Window window = windowOf(bgr, table, blob);
  std::vector<Eigen::Vector3d> inside, outside;
  for (int y = window.top; y < window.top + window.height; ++y) {
    for (int x = window.left; x < window.left + window.width; ++x) {
      const int d = window.at(x, y);
      const bool other = table.classOf(bgr.ptr<std::uint8_t>(y) + 3 * x) != 0;
      if (d == 0) inside.push_back(colourAt(bgr, x, y));
      if (d > kReach_px && d <= kRing_px && !other) outside.push_back(colourAt(bgr, x, y));
    }
  }
  if (inside.empty() || outside.empty()) return std::nullopt;
  const Eigen::Vector3d own = median(inside), around = median(outside);
  const Eigen::Vector3d axis = own - around;
  if (axis.norm() < 20.0) return std::nullopt;

  Patch patch;
  patch.colour = blob.colour;
  patch.surround_bgr = around;
  double coverage = 0.0;
  Eigen::Vector2d sum_px(0.0, 0.0), sum_m(0.0, 0.0);
  for (int y = window.top; y < window.top + window.height; ++y) {
    for (int x = window.left; x < window.left + window.width; ++x) {
      if (window.at(x, y) > kReach_px) continue;
      const double share = (colourAt(bgr, x, y) - around).dot(axis) / axis.squaredNorm();
      const Eigen::Vector2d pixel(x, y);
      const auto here = camera.planeFromPixel(pixel, plane_height_m);
      const auto right = camera.planeFromPixel(pixel + Eigen::Vector2d(0.5, 0.0), plane_height_m);
      const auto down = camera.planeFromPixel(pixel + Eigen::Vector2d(0.0, 0.5), plane_height_m);
      if (!here || !right || !down) return std::nullopt;
      patch.samples.push_back({*here, std::clamp(share, 0.0, 1.0)});
      const double alpha = share < 0.08 ? 0.0 : std::min(share, 1.0);  // noise of the surroundings stays out
      const Eigen::Vector2d a = *right - *here, b = *down - *here;
      const double area = 4.0 * std::abs(a.x() * b.y() - a.y() * b.x());
      coverage += alpha;
      sum_px += alpha * pixel;
      patch.area_m2 += alpha * area;
      sum_m += alpha * area * *here;
    }
  }
  patch.centre_px = sum_px / coverage;
  patch.centre_m = sum_m / patch.area_m2;
  patch.metres_per_px = std::sqrt(patch.area_m2 / coverage);
  return patch;
}

}  // namespace omnifleet::markers
