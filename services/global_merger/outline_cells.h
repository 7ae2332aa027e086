#pragma once

#include <vector>

#include "geometry/polygon.h"
#include "structure/surface_map.h"

namespace omnifleet::global_merger {

/// What the cells of the map show at one outline.
struct OutlineCells {
  double seen = 1.0;   ///< share of the outline with the middle of an occupied cell within `kBeside` cells
  double alone = 1.0;  ///< of the occupied cells that are connected with those at the outline, the share that
                       ///< lies at any of the outlines; 1 if there are none
  static constexpr double kBeside = 1.5;  ///< cells between an outline and the cells at it
};

/// One entry per outline. Empty outlines have no cells.
std::vector<OutlineCells> cellsAt(const std::vector<Polygon>& outlines_m, const structure::SurfaceMap& map);

}  // namespace omnifleet::global_merger
