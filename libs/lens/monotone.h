#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <utility>

namespace omnifleet::lens {

/// Solves f(x) = target for x in [low, high], where f increases; `value_and_slope(x)` returns {f, f'}.
/// Newton's method inside a shrinking bracket, to double precision.
template <typename Function>
double solveIncreasing(const Function& value_and_slope, double target, double low, double high,
                       double guess) {
  double x = std::clamp(guess, low, high);
  for (int i = 0; i < 200; ++i) {
    const std::pair<double, double> f = value_and_slope(x);
    const double error = f.first - target;
    if (error == 0.0) return x;
    (error > 0.0 ? high : low) = x;
    double next = x - error / f.second;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    if (std::abs(next - x) <= 2.5e-16 * std::max(1.0, std::abs(x))) return next;
    x = next;
  }
  return x;
}

/// First x in (0, high] where `slope` is not positive, found on a grid and refined. Empty if f increases
/// throughout. A dip narrower than high/steps is missed; the profiles are polynomials of low degree.
template <typename Slope>
std::optional<double> firstBreak(const Slope& slope, double high, int steps = 4000) {
  double low = 0.0;
  for (int i = 1; i <= steps; ++i) {
    double x = high * i / steps;
    if (slope(x) > 0.0) {
      low = x;
      continue;
    }
    for (int k = 0; k < 60; ++k) {
      const double middle = 0.5 * (low + x);
      (slope(middle) > 0.0 ? low : x) = middle;
    }
    return x;
  }
  return std::nullopt;
}

}  // namespace omnifleet::lens
