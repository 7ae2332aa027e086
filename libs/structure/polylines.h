#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "options/options.h"
#include "structure/surface_map.h"

namespace omnifleet::structure {

struct PolylineOptions {
  double tolerance_m = 0.015;     ///< m, a mean farther from its straight piece sets a corner
  double tolerance_sigmas = 4.0;  ///< σ of the cell's mean; the larger tolerance applies
  int least_cells = 3;            ///< a stretch with fewer cells is omitted
  int max_gap_cells = 1;          ///< cells without ray ends in a row that a stretch bridges
  int least_free_cells = 4;       ///< a smaller free area has no outer border (specks inside furniture)

  static PolylineOptions read(const options::Section& section);
};

/// A stretch of walls or furniture as seen from the free area, which is on its right side.
struct Polyline {
  /// Map, in order. The border of a room that was seen completely is a ring from inside, clockwise. It is
  /// open (`closed` false), and its last point equals its first.
  std::vector<Eigen::Vector2d> points_m;
  /// True for an island that was seen all around (an obstacle). Its points are counter-clockwise, the first
  /// is not repeated, and there are at least three.
  bool closed = false;
  double sigma_m = 0.0;  ///< one direction: median σ of the cells' means, and their scatter about the line
  std::uint32_t observations = 0;  ///< median number of keyframes per cell
  std::uint64_t observers = 0;     ///< bit per robot: union over the cells
};

/// Walls and furniture as polylines, ordered by their first cell (row by row). A function of the map alone:
/// the order of `map.surface` has no influence.
///
/// The border of the free area is traced in order. It passes by occupied and unknown cells. Cells with ray
/// ends form a stretch. The stretch ends where more than `max_gap_cells` cells in a row have none, so an
/// outline is never closed across what was not seen. A wall that is one cell thick and free on both sides is
/// passed twice. An island that is thinner than half of `tolerance_m` gives an open line.
///
/// Corners of a stretch: Douglas & Peucker 1973 on the cells' means. Each straight piece is then fitted by
/// weighted total least squares, and neighbouring pieces are intersected (line_pieces.h).
/// @param map has at most one entry per cell in `surface`; entries of other than occupied cells are ignored
std::vector<Polyline> polylinesOf(const SurfaceMap& map, const PolylineOptions& options);

}  // namespace omnifleet::structure
