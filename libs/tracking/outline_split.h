#pragma once

#include <vector>

#include "tracking/prism_filter.h"
#include "tracking/remembered_outline.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

/// Typical distance between the outline that `filter` predicts and the observed one, metres on the floor
/// under the object. It is the median over the usable directions, each with weight 1/σ, because one far
/// corner supports many directions with little information. Infinity with fewer than 8 usable directions. A
/// blob that merged with another on one side still compares well on the rest.
double outlineDistance(const View& view, const PrismFilter& filter);

/// True if at least 90 % of the outline that `filter` predicts lies within the observed outline: the blob may
/// hide the object.
bool isEnclosed(const View& view, const PrismFilter& filter, double margin_m);

/// One of the objects in a blob. `outline` is what the blob showed beside the object's prism; nullptr if
/// nothing is remembered.
struct BlobOwner {
  const PrismFilter* filter;
  const RememberedOutline* outline;

  /// Predicted support in direction k, metres.
  double expectedSupport(const View& view, std::size_t k) const {
    return outline ? outline->expectedSupport(view, k, *filter) : filter->predictedSupport(view, k);
  }
};

/// Assigns the directions of a merged blob's outline to its objects (docs/methods/classifier.md). A direction
/// belongs to an object if its predicted outline exceeds every other one by `margin_m`, and the observed
/// outline does not exceed it by more than `unexplained_m` + 3 σ. `own[i]` is the view with σ = −1 in all
/// directions that do not belong to object i. `rest` is the view with σ = −1 in all directions that some
/// object explains. Returns the number of usable directions in `rest`.
int splitOutline(const View& view, const std::vector<BlobOwner>& owners, double margin_m,
                 double unexplained_m, std::vector<View>& own, View& rest);

/// Number of directions in which the observed outline exceeds the outline predicted by `filter` by more than
/// `unexplained_m` + 3 σ.
int unexplainedDirections(const View& view, const PrismFilter& filter, double unexplained_m);

/// True if at least 4 usable directions lie on the contact side (b < 0): they show where the object stands.
/// The far side only shows how far its top reaches.
bool showsContact(const View& view);

/// Number of usable directions.
int usableDirections(const View& view);

}  // namespace omnifleet::tracking
