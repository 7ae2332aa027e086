#pragma once

#include <vector>

#include "global_merger/grouping.h"

namespace omnifleet::global_merger {

/// Hull of one silhouette in map: the intersection of the half-planes of its supports. Empty if they leave it
/// open, or if none of them is usable (a region without an outline).
Polygon hullOf(const ObjectView& view);

/// Overlay of the hulls of the local maps (Choi et al. 2014, §IV.4, Fig. 13). Tracks whose hulls have a
/// common region (at least a tenth of the smaller one) show one object. Its outline is the region that at
/// least `hull_share` of its views cover; its centre is the centroid of the outline. Nothing is fitted: no
/// height, no covariance. The paper does not say which part of the overlay it keeps; share 0 is the union, 1
/// the intersection. At most kMaxHulls views of each object are overlaid, chosen evenly over robots and time.
std::vector<Group> overlayHulls(const std::vector<Candidate>& candidates, const MergerOptions& options);
inline constexpr std::size_t kMaxHulls = 8;

}  // namespace omnifleet::global_merger
