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

/// Is it no higher than a mark on the floor, as far as can be told?
bool isFlat(const Group& group, const MergerOptions& options);

/// Is it surely no higher than a mark on the floor, and do many views agree on where it lies? A rug, a sheet.
bool isMark(const Group& group, const MergerOptions& options);

/// Robot and track (the low 16 bits, as scans carry them) of what ends in marks wherever it was seen: pieces
/// of them, too, of which nothing can be fitted.
/// @param marks_m their footprints, map
std::set<std::pair<std::string, std::uint16_t>> tracksOfMarks(const std::vector<Polygon>& marks_m,
                                                              const occupancy::ContributionStore& store);

}  // namespace omnifleet::global_merger
