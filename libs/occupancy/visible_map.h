#pragma once

#include "occupancy/cell_counts.h"
#include "occupancy/voxel_counts.h"
#include "structure/surface_map.h"

namespace omnifleet::occupancy {

/// The counted cells, without those that contradict each other. The floor ends where something stands: no ray
/// sees floor behind a wall. Where the counts of all rays find a surface, a ray that went on misses it (the
/// surface has the floor's colour there), and neither floor nor edges that it shows behind are valid. So a
/// free cell is kept only if a robot drove over it or a ray reaches it without crossing an occupied cell, and
/// an occupied cell only if a ray ends at it that crosses no other and comes from free cells. Gaps of at most
/// `least_gap_m` between occupied cells hide the floor behind them: surfaces are seen through them, floor is
/// not.
///
/// Rays of up to three keyframes of each robot are used per square of four cells, the latest ones; of scans
/// that look one way only (forward cameras) three per sector of 22.5° of the heading. A function of the
/// counts and of the applied contributions. The result also has, for each occupied cell, the weighted mean of
/// the ray ends in it.
structure::SurfaceMap visibleMap(const CellCounts& counts, const AppliedSet& applied,
                                 const OccupancyOptions& options);

}  // namespace omnifleet::occupancy
