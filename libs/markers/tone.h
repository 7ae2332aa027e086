#pragma once

#include <array>
#include <cmath>
#include <cstddef>

namespace omnifleet::markers {

/// Light from the grey levels of a camera whose tone curve is a power (sRGB: about 2.2). Light is scaled so
/// that a level and its light have equal steps at a given level, so thresholds in grey levels keep their
/// meaning.
class Tone {
 public:
  /// @param gamma exponent of light by level @param at_level level with equal steps
  Tone(double gamma, double at_level) {
    for (std::size_t level = 0; level < light_.size(); ++level)
      light_[level] =
          static_cast<float>(at_level / gamma * std::pow(static_cast<double>(level) / at_level, gamma));
  }

  float light(std::size_t level) const { return light_[level]; }

 private:
  std::array<float, 256> light_{};
};

}  // namespace omnifleet::markers
