#pragma once

#include <Eigen/Core>
#include <vector>

#include "options/options.h"

namespace omnifleet::flow {

struct VectorFilterOptions {
  double max_angle_deg = 35.0;  ///< degrees from the label's common direction
  double max_ratio = 3.0;  ///< times longer or shorter than the label's median (points high up move farther)
  double noise_sigmas = 3.0;  ///< standard deviations within which neither counts
  static VectorFilterOptions read(const options::Section& section);
};

/// A displacement on the floor with the standard deviation of each component, metres.
struct Displacement {
  Eigen::Vector2d d_m;
  double sigma_m;
};

/// The filter of Choi §III.5 on the vectors of one label: sorted by their angle, the densest window of angles
/// is the label's direction; vectors outside of it, or of a length unlike the others', are misrecognised.
/// Displacements within the noise have no direction and are judged by length only.
/// @return indices of the kept vectors, sorted by angle (−π, π]
std::vector<std::size_t> filterVectors(const std::vector<Displacement>& vectors,
                                       const VectorFilterOptions& options);

/// Height of a static object from the lengths of its vectors: seen from height H, a point at height h moves
/// on the floor by s·u, s = H/(H − h), when u is the displacement of a floor point at the camera's foot after
/// removing the rotation. Takes the upper decile over the vectors.
struct Height {
  double height_m = 0.0, sigma_m = 0.0;  ///< σ 0: unknown
};
Height heightFromVectors(const std::vector<Displacement>& vectors, const Eigen::Vector2d& u_m,
                         double camera_height_m);

}  // namespace omnifleet::flow
