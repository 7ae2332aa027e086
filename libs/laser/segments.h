#pragma once

#include <vector>

#include "laser/beams.h"
#include "options/options.h"

namespace omnifleet::laser {

struct SegmentOptions {
  double grazing_deg = 10.0;  ///< degrees: a face seen flatter than this falls to pieces (Borges & Aldon's λ)
  double jump_sigmas = 4.0;   ///< σ of a range that two neighbours may differ on top
  static SegmentOptions read(const options::Section& section);
};

/// Beams that hit one surface: `first`, … `first + count − 1` (Beams::at).
struct Segment {
  std::size_t first = 0, count = 0;
  /// Whether something nearer (or the end of the field of view) hides what lies beyond its first and last
  /// beam.
  bool hidden_before = false, hidden_after = false;
};

/// Cuts a scan where ranges jump: the adaptive breakpoint detector of Borges & Aldon 2004, "Line extraction
/// in 2D range images for mobile robotics", eq. 4: neighbours belong together within D = r·sin Δφ / sin(λ −
/// Δφ) + k·σ, r the nearer range, Δφ the beams' spacing.
void segments(const Beams& beams, double range_sigma_m, const SegmentOptions& options,
              std::vector<Segment>& out);

}  // namespace omnifleet::laser
