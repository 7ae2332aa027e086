#include "motion/view.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::motion {
namespace {

// Contours cut by the edge of the visible floor follow it up to this distance (m), as in NearField.
constexpr double kEdgeM = 0.015;
constexpr double kSurelyBefore = 3.0;  // σ, as free_sigmas of the map

struct Sector {
  std::size_t first = 0, rays = 0;
};

/// The valid rays without the longest run of invalid ones.
Sector validSector(const std::vector<RayLabel>& label) {
  const std::size_t n = label.size();
  Sector gap{0, 0};
  for (std::size_t begin = 0; begin < n; ++begin) {
    if (label[begin] != RayLabel::kInvalid || label[(begin + n - 1) % n] == RayLabel::kInvalid) continue;
    std::size_t length = 0;
    while (length < n && label[(begin + length) % n] == RayLabel::kInvalid) ++length;
    if (length > gap.rays) gap = {begin, length};
  }
  if (gap.rays == 0 && n > 0 && label[0] == RayLabel::kInvalid) return {};
  return {(gap.first + gap.rays) % std::max<std::size_t>(1, n), n - gap.rays};
}

struct Seen {
  View::Kind kind = View::kNothing;
  double range_m = 0.0;
};

Seen seenBy(const Scan& scan, std::size_t i, double sigma_limit_m) {
  const double range_m = scan.range_m[i];
  if (scan.label[i] == RayLabel::kInvalid || !std::isfinite(range_m) || range_m < 0.0) return {};
  if (!isSolid(scan.label[i])) return {View::kFree, range_m};
  if (range_m <= scan.blind_m + kEdgeM) return {View::kSolidNear, range_m};
  const double sigma_m = i < scan.sigma_m.size() ? scan.sigma_m[i] : 0.0;
  if (sigma_m > sigma_limit_m) return {View::kFree, std::max(0.0, range_m - kSurelyBefore * sigma_m)};
  return {View::kSolid, range_m};
}

}  // namespace

View compactView(const Scan& scan, double sigma_limit_m) {
  View view;
  view.origin_m = scan.origin_m;
  view.blind_m = static_cast<float>(scan.blind_m);
  const std::size_t n = scan.range_m.size();
  if (n == 0 || scan.label.size() != n) return view;
  const Sector sector = validSector(scan.label);
  if (sector.rays == 0) return view;
  const std::size_t share = (sector.rays + View::kMostRays - 1) / View::kMostRays;
  const double step_rad = 2.0 * M_PI / static_cast<double>(n);
  view.step_rad = static_cast<float>(step_rad * static_cast<double>(share));
  view.first_rad = static_cast<float>(
      step_rad * (static_cast<double>(sector.first) + 0.5 * static_cast<double>(share - 1)));
  for (std::size_t begin = 0; begin < sector.rays; begin += share) {
    Seen nearest;
    for (std::size_t i = begin; i < std::min(begin + share, sector.rays); ++i) {
      const Seen seen = seenBy(scan, (sector.first + i) % n, sigma_limit_m);
      if (seen.kind == View::kNothing) continue;
      if (nearest.kind == View::kNothing || seen.range_m < nearest.range_m) nearest = seen;
    }
    view.ray.push_back(View::entry(nearest.kind, nearest.range_m));
  }
  return view;
}

double fieldOfView(const View& view) {
  return view.ray.empty() ? 0.0 : view.step_rad * static_cast<double>(view.ray.size() - 1);
}

}  // namespace omnifleet::motion
