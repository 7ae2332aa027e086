#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "global_merger/grouping.h"
#include "global_merger/merger.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::global_merger {

/// Tracks (robot, low 16 bits of the id as in scans) whose rays end in floor markings wherever they were
/// seen, including pieces of markings for which nothing can be fitted.
/// @param markings_m footprints of the markings, map
std::set<std::pair<std::string, std::uint16_t>> tracksOfFloorMarkings(
    const std::vector<Polygon>& markings_m, const occupancy::ContributionStore& store);

}  // namespace omnifleet::global_merger
