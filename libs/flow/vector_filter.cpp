#include "flow/vector_filter.h"

#include <algorithm>
#include <cmath>
#include <numeric>

namespace omnifleet::flow {

VectorFilterOptions VectorFilterOptions::read(const options::Section& section) {
  VectorFilterOptions o;
  section.read("max_angle_deg", o.max_angle_deg, {1.0, 180.0});
  section.read("max_ratio", o.max_ratio, {1.0, 100.0});
  section.read("noise_sigmas", o.noise_sigmas, {0.0, 100.0});
  section.finish();
  return o;
}

namespace {

double angleOf(const Displacement& v) {
  return std::atan2(v.d_m.y(), v.d_m.x());
}

double medianLength(const std::vector<Displacement>& vectors, const std::vector<std::size_t>& which) {
  std::vector<double> lengths;
  for (const std::size_t i : which) lengths.push_back(vectors[i].d_m.norm());
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  return *middle;
}

/// Mean of the sorted angles in the window of the given width that contains most of them. Among equals, the
/// first window.
double densestDirection(const std::vector<double>& sorted, double width) {
  std::size_t best = 0, best_begin = 0;
  const std::size_t n = sorted.size();
  const auto unwrapped = [&](std::size_t i) { return sorted[i % n] + (i >= n ? 2.0 * M_PI : 0.0); };
  std::size_t end = 0;
  for (std::size_t begin = 0; begin < n; ++begin) {
    end = std::max(end, begin);
    while (end < begin + n && unwrapped(end) - sorted[begin] <= width) ++end;
    if (end - begin > best) {
      best = end - begin;
      best_begin = begin;
    }
  }
  double sum = 0.0;
  for (std::size_t i = 0; i < best; ++i) sum += unwrapped(best_begin + i);
  return sum / static_cast<double>(best);
}

}  // namespace

std::vector<std::size_t> filterVectors(const std::vector<Displacement>& vectors,
                                       const VectorFilterOptions& options) {
  std::vector<std::size_t> order(vectors.size());
  std::iota(order.begin(), order.end(), std::size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](std::size_t a, std::size_t b) { return angleOf(vectors[a]) < angleOf(vectors[b]); });
  const auto isNoise = [&](const Displacement& v) {
    return v.d_m.norm() <= options.noise_sigmas * v.sigma_m;
  };
  std::vector<double> angles;
  for (const std::size_t i : order)
    if (!isNoise(vectors[i])) angles.push_back(angleOf(vectors[i]));
  if (!angles.empty()) {
    const double width = options.max_angle_deg * M_PI / 180.0;
    const double direction = densestDirection(angles, 2.0 * width);
    order.erase(std::remove_if(order.begin(), order.end(),
                               [&](std::size_t i) {
                                 const double off =
                                     std::remainder(angleOf(vectors[i]) - direction, 2.0 * M_PI);
                                 return !isNoise(vectors[i]) && std::abs(off) > width;
                               }),
                order.end());
  }
  if (order.empty()) return order;
  const double median = medianLength(vectors, order);
  order.erase(std::remove_if(order.begin(), order.end(),
                             [&](std::size_t i) {
                               const double length = vectors[i].d_m.norm();
                               const double slack = options.noise_sigmas * vectors[i].sigma_m;
                               return length > options.max_ratio * median + slack ||
                                      length < median / options.max_ratio - slack;
                             }),
              order.end());
  return order;
}

Height heightFromVectors(const std::vector<Displacement>& vectors, const Eigen::Vector2d& u_m,
                         double camera_height_m) {
  constexpr double kMinMotion_m = 0.005;  // below this, the lengths contain no information
  const double u = u_m.norm();
  if (vectors.empty() || u < kMinMotion_m) return {};
  std::vector<std::pair<double, double>> scale;  // s and its σ
  for (const auto& v : vectors) scale.emplace_back(v.d_m.dot(u_m) / (u * u), v.sigma_m / u);
  const auto upper = static_cast<std::ptrdiff_t>(0.9 * static_cast<double>(scale.size() - 1));
  std::nth_element(scale.begin(), scale.begin() + upper, scale.end());
  const auto [s, sigma] = scale[static_cast<std::size_t>(upper)];
  const double bounded = std::max(s, 1.0);
  return {camera_height_m * (1.0 - 1.0 / bounded), camera_height_m / (bounded * bounded) * sigma};
}

}  // namespace omnifleet::flow
