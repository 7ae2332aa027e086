#pragma once

#include <vector>

#include "dataset/map_files.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::global_merger {

/// Landmarks that are told from all others by name (range and bearing detectors), in order of name: each
/// where the views of all robots put it (mean with Cauchy weights, so that a wrongly read name loses its
/// vote), as a disc of the size that was reported. Those with fewer than `min_views` views are left out.
std::vector<dataset::MapObject> namedLandmarks(const occupancy::ContributionStore& store, int min_views);

}  // namespace omnifleet::global_merger
