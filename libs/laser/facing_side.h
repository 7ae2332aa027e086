#pragma once

#include <vector>

#include "laser/line_chain.h"
#include "observation/support_function.h"

namespace omnifleet::laser {

/// One convex object as seen in one scan: the side that faces the scanner. All values are relative to the
/// scanner, in the axes of base_link.
struct FacingSide {
  std::vector<Eigen::Vector2d> outline_m;  ///< fitted, with increasing bearing
  Eigen::Vector2d nearest_m = Eigen::Vector2d::Zero();
  Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();  ///< of the echoes
  double length_m = 0.0;                             ///< between its ends
  bool round = false;        ///< an arc explains the echoes better than straight faces
  SupportFunction supports;  ///< b(n) about the scanner; σ 0 where the facing side gives no information
};

struct FacingSideOptions {
  double max_radius_m = 0.5;  ///< m, largest radius of an arc; a flatter one is a face
  double floor_m = 0.001;     ///< m, added to the σ of every support (mounting, bearing)
};

/// Fits corners and faces (line_chain.h) and a circle, and selects the better one by Schwarz's criterion (χ²
/// + ln N per parameter).
///
/// The scan determines a footprint's support h_P(n) about the scanner, b(n) = h_P(n) − n·c, exactly where the
/// scanner lies beyond the supporting line, b(n) ≤ 0: there the supporting point faces the scanner. This is
/// the contact side of the prism (docs/methods/local_mapper.md), where the unknown height has no effect. With
/// the tangents' bearings θ₀ < θ₁ these are the directions from θ₁ + 90° to θ₀ + 270°. Directions supported
/// by an end that a nearer object hides are omitted.
void facingSide(const Beams& beams, const Segment& segment, const std::vector<Piece>& pieces,
                double range_sigma_m, const FacingSideOptions& options, FacingSide& side);

}  // namespace omnifleet::laser
