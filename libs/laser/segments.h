#pragma once

#include <vector>

#include "laser/beams.h"
#include "options/options.h"

namespace omnifleet::laser {

struct SegmentOptions {
  double grazing_deg = 10.0;  ///< degrees, λ of Borges & Aldon: a surface at a flatter angle is cut
  double jump_sigmas = 4.0;   ///< σ of a range, added to the distance of two neighbours of one surface
  static SegmentOptions read(const options::Section& section);
};

/// Beams that hit one surface: `first` to `first + count − 1` (Beams::at).
struct Segment {
  std::size_t first = 0, count = 0;
  /// True if a nearer object, or the end of the field of view, hides the surface beyond its first or last
  /// beam.
  bool hidden_before = false, hidden_after = false;
};

/// Cuts a scan at range jumps with the adaptive breakpoint detector of Borges & Aldon 2004, "Line extraction
/// in 2D range images for mobile robotics", eq. 4: neighbours belong together within D = r·sin Δφ / sin(λ −
/// Δφ) + k·σ, r the nearer range, Δφ the beam spacing.
void segments(const Beams& beams, double range_sigma_m, const SegmentOptions& options,
              std::vector<Segment>& out);

}  // namespace omnifleet::laser
