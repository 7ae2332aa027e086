#pragma once

#include <cstdint>

#include "global_merger/grouping.h"
#include "global_merger/merger.h"
#include "occupancy/contribution_store.h"

namespace omnifleet::global_merger {

/// Rarely seen, and cut in every view: with very few views, or always behind another object. What a wall
/// shows above another object is a piece of the wall, and moves with the camera.
bool isPiece(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store);

/// Rarely seen, and no upright body explains the views well.
bool isRough(const Group& group, const MergerOptions& options);

/// Low, and missed as often as it was seen: in plain sight, or with the floor seen at its place from
/// anywhere. Of tiles and stains each view shows another piece; together they look like a low object.
bool isPattern(const Group& group, const MergerOptions& options, const occupancy::ContributionStore& store);

/// Evidence of the floor, seen at the place of a candidate, against it.
enum class FloorEvidence : std::uint8_t {
  kNothing,      ///< the floor was hardly seen there
  kConflicting,  ///< much, but the candidate is surely upright, and rays ended at its place repeatedly
  kAbsent,       ///< the object is gone or was never there
};
/// Not part of the overlay as printed in §IV.4. Gone: the floor was seen later, more often than explained by
/// the share of views that missed the object before. Never there: the floor was seen as often as the
/// candidate, from as near; or from anywhere many times as often; or the candidate is uncertain, and the
/// floor was seen as often, or its place was seen many times as often without it. A candidate that one
/// upright body explains well is gone only if the floor was seen afterwards many times as often as rays ended
/// at its place.
FloorEvidence floorEvidence(const Group& group, const MergerOptions& options,
                            const occupancy::ContributionStore& store);

/// The floor was seen at its place at least as often as the candidate, since that was first seen and from as
/// near.
bool isMostlyFloor(const Group& group, const occupancy::ContributionStore& store);

}  // namespace omnifleet::global_merger
