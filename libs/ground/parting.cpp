#include "ground/parting.h"

#include <algorithm>

namespace omnifleet::ground {

namespace {

constexpr float kTwoKinds = 0.8f;  // share of a region's variance of brightness that parting it in two
                                   // explains, from which it is of two kinds (a Gaussian: 0.64)

}  // namespace

Look partingOf(const std::array<int, 256>& pixels) {
  constexpr int kFirst = kColourLook + 1, kEnd = kFirst + 100;
  double n = 0.0, sum = 0.0, squares = 0.0;
  for (int i = kFirst; i < kEnd; ++i) {
    n += pixels[i];
    sum += static_cast<double>(i) * pixels[i];
    squares += static_cast<double>(i) * i * pixels[i];
  }
  const double variance = squares - sum * sum / std::max(1.0, n);
  double below = 0.0, sum_below = 0.0, best = kTwoKinds * variance;
  Look parting = kFloorLook;
  for (int i = kFirst; i + 1 < kEnd; ++i) {
    below += pixels[i];
    sum_below += static_cast<double>(i) * pixels[i];
    if (below <= 0.0 || below >= n) continue;
    const double apart = sum_below / below - (sum - sum_below) / (n - below);
    const double between = below * (n - below) / n * apart * apart;
    if (between <= best) continue;
    best = between;
    parting = static_cast<Look>(i + 1);
  }
  return parting;
}

}  // namespace omnifleet::ground
