#pragma once

#include <Eigen/Core>
#include <vector>

#include "options/options.h"

namespace omnifleet::flow {

struct VectorFilterOptions {
  double max_angle_deg = 35.0;  ///< degrees from the label's common direction
  double max_ratio =
      3.0;  ///< ratio to the median length of the label, longer or shorter (high points move farther)
  double noise_sigmas = 3.0;  ///< standard deviations within which direction and length are not tested
  static VectorFilterOptions read(const options::Section& section);
};

/// A displacement on the floor with the standard deviation of each component, metres.
struct Displacement {
  Eigen::Vector2d d_m;
  double sigma_m;
};

/// Filter of Choi §III.5 on the vectors of one label. They are sorted by angle, and the densest window of
/// angles is the direction of the label. Vectors outside the window, or with a length that differs from the
/// median, are false matches. Displacements within the noise have no direction and are tested by length only.
/// @return indices of the kept vectors, sorted by angle (−π, π]
std::vector<std::size_t> filterVectors(const std::vector<Displacement>& vectors,
                                       const VectorFilterOptions& options);

/// Height of a static object from the lengths of its vectors. Seen from height H, a point at height h moves
/// on the floor by s·u, s = H/(H − h). u is the displacement of a floor point at the foot of the camera after
/// removing the rotation. The height is that of the upper decile of s.
struct Height {
  double height_m = 0.0, sigma_m = 0.0;  ///< σ 0: unknown
};
Height heightFromVectors(const std::vector<Displacement>& vectors, const Eigen::Vector2d& u_m,
                         double camera_height_m);

}  // namespace omnifleet::flow
