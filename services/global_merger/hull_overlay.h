#pragma once

#include <vector>

#include "global_merger/grouping.h"

namespace omnifleet::global_merger {

/// The hull that one silhouette is reported with, in map: the intersection of its supports' half-planes.
/// Empty where they leave it open, or where none of them is usable (a region without an outline).
Polygon hullOf(const ObjectView& view);

/// Choi et al. 2014, §IV.4, Fig. 13: the local maps' hulls laid over one another. Tracks whose hulls have a
/// region in common (of the smaller region at least a tenth) are of one thing; its outline is what at least
/// `hull_share` of its views cover, its centre that outline's centroid. Nothing is fitted: no height, no
/// covariance. The paper does not say which part of the overlay it keeps; share 0 is the union, 1 the
/// intersection. At most kMaxHulls views of each thing are laid over one another, evenly chosen over robots
/// and time.
std::vector<Group> overlayHulls(const std::vector<Candidate>& candidates, const MergerOptions& options);
inline constexpr std::size_t kMaxHulls = 8;

}  // namespace omnifleet::global_merger
