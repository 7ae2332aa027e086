#pragma once

#include <Eigen/Core>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::local_mapper {

/// Places on the floor where a region is undecided in frame after frame, tracked as the robot drives. A
/// region in one or two frames is noise. A place that shows an object from a shorter distance is decided.
class PersistentPlaces {
 public:
  PersistentPlaces();

  /// @param motion base_link(previous) ← base_link(this frame); without it the places stay where they are
  /// @param undecided_m base_link, where the regions of this frame begin
  /// @param objects of the same frame; a place is decided once objects occupied it as often as it was
  /// undecided
  void take(const Motion& motion, const std::vector<Eigen::Vector2d>& undecided_m,
            const std::vector<ObjectObservation>& objects);

  /// Places to be reported now, base_link of the last frame: seen in kPersistent frames and not reported
  /// before. With `ended` also those that were seen in at least half of their frames and in at least three.
  /// Valid until the next call.
  const std::vector<Eigen::Vector2d>& toReport(bool ended = false);

  static constexpr int kPersistent = 10;

 private:
  struct Place {
    Eigen::Vector2d at_m;
    int frames = 0;    ///< since it was first seen
    int seen = 0;      ///< number of these in which it was seen
    int unseen = 0;    ///< frames since it was last seen
    int occupied = 0;  ///< frames in which an object was there instead
    bool is_reported = false;
  };
  std::vector<Place> places_;
  std::vector<Eigen::Vector2d> reported_m_;
};

}  // namespace omnifleet::local_mapper
