#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "geometry/polygon.h"

namespace omnifleet {

/// Support function of the convex hull of a blob's silhouette, projected to the floor. For K directions n_k =
/// (cos φ_k, sin φ_k), φ_k = 2πk/K in base_link: b_k = max over the silhouette of n_k · (x − c). x is in
/// base_link, c is the foot of the camera in base_link. Metres. (docs/methods/local_mapper.md)
struct SupportFunction {
  /// Number of directions that every stage of this project uses. Any K ≥ 3 is read correctly.
  static constexpr int kDirections = 96;

  std::vector<float> b_m;      ///< K values; empty when the silhouette is unknown.
  std::vector<float> sigma_m;  ///< K standard deviations; ≤ 0 or non-finite: do not use the direction

  bool empty() const { return b_m.empty(); }
  std::size_t size() const { return b_m.size(); }

  /// Value in any direction. Between two directions it is the support value of the corner where their
  /// half-planes meet. That is exact where one vertex supports both. σ is the larger one of the two
  /// neighbours. b is NaN if a neighbour is unusable.
  struct Value {
    double b_m;
    double sigma_m;
  };
  Value at(double angle_rad) const;

  /// Exact support function of a point set (convex or not) relative to c, with constant σ.
  static SupportFunction of(const Polygon& points, const Eigen::Vector2d& c, double sigma_m,
                            int directions = kDirections);
};

}  // namespace omnifleet
