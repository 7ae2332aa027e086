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

/// Whether it is no higher than a floor marking, as far as the views show.
bool isFlat(const Group& group, const MergerOptions& options);

/// Whether it is surely no higher than a floor marking and many views agree on its place: a rug, a sheet.
bool isFloorMarking(const Group& group, const MergerOptions& options);

/// Tracks (robot, low 16 bits of the id as in scans) whose rays end in floor markings wherever they were
/// seen, including pieces of markings for which nothing can be fitted.
/// @param markings_m footprints of the markings, map
std::set<std::pair<std::string, std::uint16_t>> tracksOfFloorMarkings(
    const std::vector<Polygon>& markings_m, const occupancy::ContributionStore& store);

}  // namespace omnifleet::global_merger
