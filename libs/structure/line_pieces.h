#pragma once

// Internal to libs/structure: the straight pieces of one stretch of surface cells.

#include <Eigen/Core>
#include <vector>

#include "structure/polylines.h"
#include "structure/surface_map.h"

namespace omnifleet::structure::detail {

/// Surface cells in order along a border.
struct Stretch {
  std::vector<const SurfaceCell*> cells;
  bool is_ring = false;  ///< the first cell follows the last
};

/// Vertices of the straight pieces through a stretch; of a ring, the first vertex is not repeated.
///
/// 1. Corners by Douglas–Peucker. A mean may deviate from the chord by tolerance_m or tolerance_sigmas·σ.
/// 2. Two neighbouring pieces are merged if one line fits both within half of that tolerance: chords between
///    noisy means have more corners than the surface.
/// 3. A cell that contains a corner has ray ends on both faces. Its mean lies inside the corner, which looks
///    cut off. Short pieces are replaced by the intersection of their neighbours if the means agree with
///    that corner.
/// 4. Each piece is fitted by total least squares with weights 1/σ². Cells at corners have a larger σ. The
///    vertices are the intersections of neighbouring lines. If the intersection is more than one and a half
///    cells from the corner's cell, the mean of that cell is projected on both lines, and their middle is
///    used. The ends of an open stretch are projected on their line.
std::vector<Eigen::Vector2d> verticesOf(const Stretch& stretch, const SurfaceMap& map,
                                        const PolylineOptions& options);

}  // namespace omnifleet::structure::detail
