#pragma once

#include <Eigen/Core>
#include <vector>

#include "structure/polylines.h"
#include "structure/surface_map.h"

namespace omnifleet::structure {

struct MirrorOptions {
  bool search = true;                ///< whether openings that can be mirrors are looked for
  double contradicting_share = 0.1;  ///< of the cells compared, by noise; significantly (3 σ) more: no mirror
  double least_piece_m = 0.2;        ///< m, straight pieces on both sides of the opening, at least
  double least_width_m = 0.2;        ///< m, of the opening
  double greatest_width_m = 3.0;     ///< m

  static MirrorOptions read(const options::Section& section);
};

/// Finds gaps in straight walls that can be mirrors or doors, for nothing in the images distinguishes the
/// two. A gap is bordered by two straight pieces in one line and has floor on both sides. It is a door if a
/// robot was on the other side, or if the other side is no mirror image: where something stands, its image on
/// this side is free floor, or the other way round. Cells within two cells of the image count as equal (σ of
/// mirrored ends). Else all that is connected with the gap on its other side becomes unknown, and the gap is
/// added to `map.mirrors`. A function of the map and of the set of places.
/// @param robots_m places of the robots, map
/// @param reach_m from a robot's place to cells that its body does not cover
void hideBehindMirrors(SurfaceMap& map, const std::vector<Eigen::Vector2d>& robots_m, double reach_m,
                       const MirrorOptions& options);

}  // namespace omnifleet::structure
