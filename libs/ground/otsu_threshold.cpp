#include "ground/otsu_threshold.h"

#include <algorithm>

namespace omnifleet::ground {

namespace {

constexpr float kTwoKinds =
    0.8f;  // minimum share of the brightness variance that two kinds explain (a Gaussian: 0.64)

}  // namespace

Appearance otsuThreshold(const std::array<int, 256>& pixels) {
  constexpr int kFirst = kColourAppearance + 1, kEnd = kFirst + 100;
  double n = 0.0, sum = 0.0, squares = 0.0;
  for (int i = kFirst; i < kEnd; ++i) {
    n += pixels[i];
    sum += static_cast<double>(i) * pixels[i];
    squares += static_cast<double>(i) * i * pixels[i];
  }
  const double variance = squares - sum * sum / std::max(1.0, n);
  double below = 0.0, sum_below = 0.0, best = kTwoKinds * variance;
  Appearance threshold = kFloorAppearance;
  for (int i = kFirst; i + 1 < kEnd; ++i) {
    below += pixels[i];
    sum_below += static_cast<double>(i) * pixels[i];
    if (below <= 0.0 || below >= n) continue;
    const double apart = sum_below / below - (sum - sum_below) / (n - below);
    const double between = below * (n - below) / n * apart * apart;
    if (between <= best) continue;
    best = between;
    threshold = static_cast<Appearance>(i + 1);
  }
  return threshold;
}

}  // namespace omnifleet::ground
