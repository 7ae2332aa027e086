#pragma once

// Internal to libs/structure: the borders of the free area, traced in order.

#include <cstdint>
#include <vector>

#include "structure/surface_map.h"

namespace omnifleet::structure::detail {

inline constexpr int kOutside = -1;  ///< beyond the map

/// A closed border of one free area. The walk has the free area on its right side.
struct Border {
  /// Cells that are not free beside the border, in order: index x + y·width or kOutside. Equal neighbours in
  /// the sequence are one entry, except kOutside, which has one entry per side of a cell.
  std::vector<int> cells;
  /// Enclosed area, in cells. Positive: the walk runs counter-clockwise around an island. Negative: it runs
  /// clockwise along the outer border of a free area.
  std::int64_t area = 0;
};

/// All borders, in the order in which a scan row by row meets them. Each side between a free cell and
/// another cell belongs to exactly one border. Free cells are connected over their 4 sides, the other cells
/// over 8 neighbours: a diagonal row of occupied cells separates free areas. In an inner corner of the free
/// area, the diagonal cell is in the sequence if it is occupied. Time is linear in the number of cells.
std::vector<Border> bordersOf(const SurfaceMap& map);

}  // namespace omnifleet::structure::detail
