#pragma once

#include "tracking/prism_filter.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

/// What a blob showed while it was all one track's: sharp corners that the prism leaves out, or what stood in
/// it unknown, now joined to it and now apart. Once others have come into that blob, what it showed before is
/// none of theirs. Good as long as the camera stays within 10 cm: a thing at another depth shifts against the
/// prism.
class RememberedOutline {
 public:
  /// Takes in this frame's outline; from another place it starts afresh.
  void add(const View& view, const PrismFilter& filter);
  void forget() { last_.supports.b_m.clear(); }
  bool isGood(const View& view) const;
  /// Support in direction k (metres) that is remembered and comes nearest to the one seen; what `filter`
  /// predicts where nothing is remembered.
  double expectedSupport(const View& view, std::size_t k, const PrismFilter& filter) const;

 private:
  /// What was seen then in this direction, from here.
  double fromHere(const SupportFunction& then, const View& view, std::size_t k,
                  const PrismFilter& filter) const;

  Eigen::Vector2d origin_m_ = Eigen::Vector2d::Zero();  ///< foot of the camera when it started, odom
  View last_;
  SupportFunction outermost_;  ///< of all so far, as from the last place
  SupportFunction next_;       ///< what that becomes
};

}  // namespace omnifleet::tracking
