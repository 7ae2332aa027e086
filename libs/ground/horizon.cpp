#include "ground/horizon.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr double kDegree = M_PI / 180.0;
constexpr double kLowest_deg = 0.75, kHighest_deg = 6.0;  // above the horizon; tilts are known to 0.5°
constexpr double kEdge_deg = 8.0;  // below the horizon: 3.5 m away for a camera at 0.5 m
constexpr std::size_t kLeast_px = 12,
                      kMost_px = 40;  // pixels per sector: fewer are not reliable, more cost time
constexpr std::size_t kAhead = 16;    // pixels to prefetch ahead
constexpr float kUnseen = -1.0f;

std::size_t sectorOf(const Eigen::Vector3d& ray) {
  const double turns = std::atan2(ray.y(), ray.x()) / (2.0 * M_PI) + 0.5;
  return static_cast<std::size_t>(
      1 + std::min(Horizon::kSectors - 1, static_cast<int>(turns * Horizon::kSectors)));
}

}  // namespace

Horizon::Horizon(const lens::Camera& camera, const FloorView& floor_view)
    : sectors_(floor_view.cells(), std::uint8_t{0}),
      edge_(kSectors + 1),
      pixels_(kSectors + 1),
      colours_(kSectors + 1, cv::Vec4f::all(kUnseen)) {
  findEdge(camera, floor_view);
  findPixels(camera);
}

void Horizon::findEdge(const lens::Camera& camera, const FloorView& floor_view) {
  for (int y = 0; y < sectors_.rows; ++y) {
    for (int x = 0; x < sectors_.cols; ++x) {
      const auto ray = camera.rayFromPixel({(x + 0.5) * kCell - 0.5, (y + 0.5) * kCell - 0.5});
      if (!ray || floor_view.coverage()(y, x) == 0) continue;
      const std::size_t sector = sectorOf(*ray);
      sectors_(y, x) = static_cast<std::uint8_t>(sector);
      if (floor_view.coverage()(y, x) == 2 && ray->z() > -std::sin(kEdge_deg * kDegree))
        edge_[sector].emplace_back(x, y);
    }
  }
}

/// Selects pixels above the horizon, evenly per sector.
void Horizon::findPixels(const lens::Camera& camera) {
  const auto view = FloorView::upward(camera);
  if (!view) return;
  for (int v = 0; v < view->mask().rows; ++v) {
    for (int u = 0; u < view->mask().cols; ++u) {
      if (view->mask()(v, u) == 0) continue;
      const auto ray = camera.rayFromPixel({u, v});
      if (!ray || ray->z() < std::sin(kLowest_deg * kDegree) || ray->z() > std::sin(kHighest_deg * kDegree))
        continue;
      pixels_[sectorOf(*ray)].emplace_back(u, v);
    }
  }
  for (std::vector<cv::Point>& pixels : pixels_) {
    const std::size_t all = pixels.size(), few = std::min(all, kMost_px);
    for (std::size_t i = 0; i < few; ++i) pixels[i] = pixels[i * all / few];
    pixels.resize(all < kLeast_px ? 0 : few);
  }
}

void Horizon::read(const cv::Mat& image) {
  for (std::size_t sector = 1; sector < pixels_.size(); ++sector) {
    const std::vector<cv::Point>& pixels = pixels_[sector];
    if (pixels.empty()) continue;
    int sum[3] = {};
    for (std::size_t k = 0; k < pixels.size(); ++k) {
      // The pixels lie in different rows.
      const cv::Point &p = pixels[k], &next = pixels[std::min(k + kAhead, pixels.size() - 1)];
      __builtin_prefetch(image.ptr(next.y) + next.x * image.channels());
      const std::uint8_t* at = image.ptr(p.y) + p.x * image.channels();
      for (int c = 0; c < 3; ++c) sum[c] += at[image.channels() == 3 ? c : 0];
    }
    const float share = 1.0f / static_cast<float>(pixels.size());
    for (int c = 0; c < 3; ++c) colours_[sector][c] = share * static_cast<float>(sum[c]);
    colours_[sector][3] = 0.0f;
  }
}

}  // namespace omnifleet::ground
