#pragma once

#include "tracking/prism_filter.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

/// The outline that a blob showed while it belonged to one track. It includes sharp corners that the prism
/// omits, and unknown objects that are sometimes joined to the blob. When other objects join the blob, the
/// remembered outline still belongs to this track. It is valid while the camera stays within 10 cm, because
/// objects at another depth shift against the prism.
class RememberedOutline {
 public:
  /// Adds the outline of this frame. From a place more than 10 cm away the memory restarts.
  void add(const View& view, const PrismFilter& filter);
  void forget() { last_.supports.b_m.clear(); }
  bool isGood(const View& view) const;
  /// Remembered support in direction k (metres) that is closest to the observed one; the prediction of
  /// `filter` where nothing is remembered.
  double expectedSupport(const View& view, std::size_t k, const PrismFilter& filter) const;

 private:
  /// Support remembered in this direction, transferred to the current place.
  double fromHere(const SupportFunction& then, const View& view, std::size_t k,
                  const PrismFilter& filter) const;

  Eigen::Vector2d origin_m_ = Eigen::Vector2d::Zero();  ///< foot of the camera when the memory started, odom
  View last_;
  SupportFunction outermost_;  ///< maximum of all outlines so far, as seen from the last place
  SupportFunction next_;       ///< buffer for the next maximum
};

}  // namespace omnifleet::tracking
