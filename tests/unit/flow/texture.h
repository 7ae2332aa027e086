#pragma once

// A smooth random texture that can be evaluated at any position, so that shifted images are exact.

#include <cmath>
#include <opencv2/core.hpp>
#include <random>
#include <vector>

namespace omnifleet::flow::testing {

/// Sum of plane waves with wavelengths between `shortest` and 8 times that; mean 128, clamped to 8 bits.
class Texture {
 public:
  Texture(double shortest, unsigned seed) {
    std::mt19937 random(seed);
    std::uniform_real_distribution<double> unit(0.0, 1.0);
    for (int i = 0; i < 40; ++i) {
      const double angle = 2 * M_PI * unit(random), length = shortest * std::pow(8.0, unit(random));
      waves_.push_back({2 * M_PI * std::cos(angle) / length, 2 * M_PI * std::sin(angle) / length,
                        2 * M_PI * unit(random)});
    }
  }
  double operator()(double x, double y) const {
    double sum = 128.0;
    for (const auto& w : waves_) sum += 12.0 * std::sin(w.kx * x + w.ky * y + w.phase);
    return sum;
  }
  /// Image whose pixel (u, v) shows the texture at (u − du, v − dv).
  cv::Mat1b image(int width, int height, double du = 0.0, double dv = 0.0) const {
    cv::Mat1b out(height, width);
    for (int v = 0; v < height; ++v)
      for (int u = 0; u < width; ++u) out(v, u) = cv::saturate_cast<std::uint8_t>((*this)(u - du, v - dv));
    return out;
  }

 private:
  struct Wave {
    double kx, ky, phase;
  };
  std::vector<Wave> waves_;
};

}  // namespace omnifleet::flow::testing
