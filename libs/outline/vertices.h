#pragma once

#include <vector>

#include "geometry/polygon.h"

namespace omnifleet::outline {

/// A measured value of a support function: max over the polygon of n·p in direction n.
struct SupportSample {
  double angle_rad = 0.0;
  double support_m = 0.0;
  double weight = 0.0;  ///< 1/σ², m⁻²
};

/// Convex polygon with few vertices that explains support samples at any angles. The circle is cut into arcs,
/// each explained by one vertex (n·p = h, least squares), so that the weighted squares plus `penalty` per
/// vertex are minimal (dynamic programming over 192 bins, Bellman 1961). Half-planes at fixed directions
/// circumscribe the shape: if an edge's normal lies between two directions, a corner exceeds the shape by a
/// quarter of the edge's length times the angle between them. This method finds the edge itself. `centre` is
/// a point near the middle. Returns an empty polygon if fewer than three vertices result.
Polygon polygonOfSamples(const std::vector<SupportSample>& samples, const Eigen::Vector2d& centre,
                         double penalty);

}  // namespace omnifleet::outline
