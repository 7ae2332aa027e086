#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "geometry/polygon.h"

namespace omnifleet {

/// Support function of the convex hull of a blob's silhouette, projected to the floor: for K directions
/// n_k = (cos φ_k, sin φ_k), φ_k = 2πk/K measured in base_link, b_k = max over the silhouette of n_k · (x −
/// c), x and c in base_link, c the foot of the camera. Metres. (docs/methods.md, "Support-function prism".)
struct SupportFunction {
  /// Directions used by every stage of this project; any K ≥ 3 is read correctly.
  static constexpr int kDirections = 96;

  std::vector<float> b_m;      ///< K values; empty when the silhouette is unknown.
  std::vector<float> sigma_m;  ///< K standard deviations; ≤ 0 or non-finite marks a direction not to be used.

  bool empty() const { return b_m.empty(); }
  std::size_t size() const { return b_m.size(); }

  /// Value in any direction. Between two directions it is the support of the corner of their half-planes:
  /// exact where one vertex supports both. σ is the larger of the neighbours'; NaN b where a neighbour is
  /// unusable.
  struct Value {
    double b_m;
    double sigma_m;
  };
  Value at(double angle_rad) const;

  /// Exact support function of a convex or non-convex point set relative to c; σ constant.
  static SupportFunction of(const Polygon& points, const Eigen::Vector2d& c, double sigma_m,
                            int directions = kDirections);
};

}  // namespace omnifleet
