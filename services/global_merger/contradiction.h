#pragma once

#include <cstdint>

#include "global_merger/grouping.h"
#include "global_merger/merger.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::global_merger {

/// Seldom seen, and each time cut off: hardly ever, or behind something else. What a wall shows over another
/// thing is a piece of the wall, and goes with the camera.
bool isPiece(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store);

/// Seldom seen, and nothing upright explains the views well.
bool isRough(const Group& group, const MergerOptions& options);

/// Low, and in plain sight, or from wherever the floor is seen there, lost as often as it was seen: of tiles
/// and stains another piece shows in every view, and together they look like something low.
bool isPattern(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store);

/// What the floor, seen where a thing was seen, says against it.
enum class FloorSays : std::uint8_t {
  kNothing,  ///< it was hardly seen there
  kLess,  ///< much, but what was seen is surely upright, and something was met in its place again and again
  kNotThere,  ///< it has gone, or was never there
};
/// The overlay as printed, §IV.4, does not ask. Gone: the floor was seen later, more often in a row than
/// before. Never there: it was as often, from as near; or from anywhere many times as often; or the thing is
/// doubtful, and the floor was seen as often, or its place many times as often without it. What one upright
/// body explains well has gone only where the floor was seen many times as often afterwards as anything was
/// met in its place.
FloorSays floorSays(const Group& group, const MergerOptions& options,
                    const occupancy::ContributionStore& store);

/// The floor was seen in its place as often as it was, since it was first seen and from as near.
bool isMostlyFloor(const Group& group, const occupancy::ContributionStore& store);

}  // namespace omnifleet::global_merger
