#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace omnifleet {

/// Where the floor ends per bearing, seen from `origin_m`: bearing_i = 2πi/N in base_link. In inverse range a
/// straight wall is a linear function of the bearing's cosine and sine, and the noise of a camera is nearly
/// even. Lasers fill the same structure.
struct Boundary {
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();  ///< foot of the camera (or laser) in base_link
  std::vector<float> inverse_m;                        ///< 1/range, 1/m; 0: no edge found
  std::vector<float> sigma;                            ///< 1/m, of inverse_m; 0 where no edge was found
  /// 1: the beam ends at a robot or at another moving object, so localisation does not use it. Empty: none.
  std::vector<std::uint8_t> moving;

  void clear() {
    inverse_m.clear();
    sigma.clear();
    moving.clear();
  }
};

}  // namespace omnifleet
