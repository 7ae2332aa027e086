#pragma once

#include <vector>

#include "tracking/prism_filter.h"
#include "tracking/remembered_outline.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

/// Typical distance between the outline that `filter` should show and the one seen, metres on the floor under
/// the object: the median over the usable directions, each weighing 1/σ, as one corner far behind supports
/// many of them and tells little; infinity with fewer than 8. A blob that has run together with another on
/// one side still compares well on the rest.
double outlineDistance(const View& view, const PrismFilter& filter);

/// True when nearly everything that `filter` should show lies within the seen outline: it may be hidden in
/// it.
bool isSwallowed(const View& view, const PrismFilter& filter, double margin_m);

/// One of the objects in a blob, and what it is known to show beside its prism (nullptr: nothing).
struct BlobOwner {
  const PrismFilter* filter;
  const RememberedOutline* outline;

  /// Support that it should show, metres.
  double expectedSupport(const View& view, std::size_t k) const {
    return outline ? outline->expectedSupport(view, k, *filter) : filter->predictedSupport(view, k);
  }
};

/// One blob, several objects: which directions of its outline belong to whom. A direction is an object's own
/// where its predicted outline stands out from every other's by `margin_m` (docs/methods.md, "Merged blobs":
/// keep a direction only where its supporting point lies off the cut), and where nothing unknown stands out
/// farther still
/// (`alien_m` + 3 σ). `own[i]` is the view with σ = −1 in all other directions; `rest` likewise with the
/// directions that none explains. Returns the number of directions in `rest`.
int splitOutline(const View& view, const std::vector<BlobOwner>& owners, double margin_m, double alien_m,
                 std::vector<View>& own, View& rest);

/// Directions in which the outline stands out from what `filter` should show by `alien_m` + 3 σ.
int alienDirections(const View& view, const PrismFilter& filter, double alien_m);

/// Whether enough directions show where it stands on the floor, not how far its top reaches.
bool showsContact(const View& view);

/// Number of usable directions.
int usableDirections(const View& view);

}  // namespace omnifleet::tracking
