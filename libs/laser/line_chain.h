#pragma once

#include <vector>

#include "laser/beams.h"
#include "laser/segments.h"

namespace omnifleet::laser {

/// Straight piece of a surface. `first` and `last` count from the segment's first beam; neighbouring pieces
/// share a beam.
struct Piece {
  std::size_t first = 0, last = 0;
  Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d along = Eigen::Vector2d::UnitX();  ///< unit vector, with increasing bearing
  double squares_m2 = 0.0;                           ///< sum of squared distances from its line
  double spread_m2 = 0.0;                            ///< sum of squared positions along it, about their mean
  std::size_t count() const { return last - first + 1; }
};

/// Split and merge (iterative end point fit; Nguyen et al. 2005, "A comparison of line extraction algorithms
/// using 2D laser rangefinder for indoor mobile robotics"). Each piece is then fitted by total least squares.
/// @param tolerance_m distance from the chord at which a piece is split
void lineChain(const Beams& beams, const Segment& segment, double tolerance_m, std::vector<Piece>& pieces);

/// Angle by which the chain turns between two pieces, radians: > 0 at a convex corner (towards the scanner),
/// < 0 at a concave one.
double bulge(const Piece& before, const Piece& after);

/// σ of that angle from the noise of the echoes, radians.
double bulgeSigma(const Piece& before, const Piece& after, double range_sigma_m);

/// Intersection of the lines of two neighbouring pieces; the place of the shared beam if they are nearly
/// parallel.
Eigen::Vector2d corner(const Beams& beams, const Segment& segment, const Piece& before, const Piece& after);

}  // namespace omnifleet::laser
