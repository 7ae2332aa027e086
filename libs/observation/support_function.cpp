#include "observation/support_function.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet {

SupportFunction::Value SupportFunction::at(double angle_rad) const {
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  const auto k = static_cast<double>(b_m.size());
  if (b_m.size() < 3) return {kNan, kNan};
  const double step = 2.0 * M_PI / k;
  double turns = std::fmod(angle_rad / step, k);
  if (turns < 0) turns += k;
  const auto i = static_cast<std::size_t>(turns) % b_m.size();
  const std::size_t j = (i + 1) % b_m.size();
  const auto usable = [&](std::size_t n) {
    return std::isfinite(b_m[n]) && std::isfinite(sigma_m[n]) && sigma_m[n] > 0;
  };
  const double beyond = (turns - std::floor(turns)) * step;
  if (step - beyond < 1e-9) return usable(j) ? Value{b_m[j], sigma_m[j]} : Value{kNan, kNan};
  if (beyond < 1e-9) return usable(i) ? Value{b_m[i], sigma_m[i]} : Value{kNan, kNan};
  if (!usable(i) || !usable(j)) return {kNan, kNan};
  const double b = (b_m[i] * std::sin(step - beyond) + b_m[j] * std::sin(beyond)) / std::sin(step);
  return {b, std::max(sigma_m[i], sigma_m[j])};
}

SupportFunction SupportFunction::of(const Polygon& points, const Eigen::Vector2d& c, double sigma_m,
                                    int directions) {
  SupportFunction support;
  if (points.empty()) return support;
  support.b_m.resize(static_cast<std::size_t>(directions));
  support.sigma_m.assign(static_cast<std::size_t>(directions), static_cast<float>(sigma_m));
  for (int k = 0; k < directions; ++k) {
    const double phi = 2.0 * M_PI * k / directions;
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    double best = -std::numeric_limits<double>::infinity();
    for (const auto& p : points) best = std::max(best, n.dot(p - c));
    support.b_m[static_cast<std::size_t>(k)] = static_cast<float>(best);
  }
  return support;
}

}  // namespace omnifleet
