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

/// Convex polygon with few vertices that explains samples at any angles: the circle is cut into arcs, each
/// explained by one vertex (n·p = h, least squares), so that the weighted squares plus `penalty` per vertex
/// are least (dynamic programming over 192 bins, Bellman 1961). Half-planes at fixed directions circumscribe:
/// where an edge's normal falls between two of them a corner stands out by a quarter of the edge's length
/// times their angle; this finds the edge. `centre` lies inside, about. Empty when fewer than three vertices
/// come out.
Polygon polygonOfSamples(const std::vector<SupportSample>& samples, const Eigen::Vector2d& centre,
                         double penalty);

}  // namespace omnifleet::outline
