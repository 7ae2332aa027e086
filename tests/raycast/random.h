#pragma once

#include <Eigen/Core>
#include <cmath>
#include <random>

namespace omnifleet::raycast {

/// Random numbers that depend on the seed alone, not on the standard library's distributions.
class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double between(double low, double high) { return low + (high - low) * (engine_() / 4294967296.0); }
  int below(int n) { return static_cast<int>(engine_() % static_cast<unsigned>(n)); }
  double normal(double sigma) {
    return sigma * std::sqrt(-2.0 * std::log(between(1e-12, 1.0))) * std::cos(between(0.0, 2.0 * M_PI));
  }
  Eigen::Vector3d colour(double low, double high) {
    return {between(low, high), between(low, high), between(low, high)};
  }

 private:
  std::mt19937 engine_;
};

}  // namespace omnifleet::raycast
