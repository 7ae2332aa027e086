#pragma once

#include <vector>

#include "dataset/map_files.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::global_merger {

/// Landmarks with unique names (range and bearing detectors), ordered by name. Each is placed at the mean of
/// the views of all robots, with Cauchy weights, so that a misread name loses its influence, as a disc of the
/// reported size. Landmarks with fewer than `min_views` views are left out.
std::vector<dataset::MapObject> namedLandmarks(const occupancy::ContributionStore& store, int min_views);

}  // namespace omnifleet::global_merger
