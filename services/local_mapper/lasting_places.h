#pragma once

#include <Eigen/Core>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::local_mapper {

/// Places on the floor where frame after frame something is undecided, followed as the robot drives. What
/// shows in a frame or two is noise, and what is taken for a thing from nearer by is decided.
class LastingPlaces {
 public:
  LastingPlaces();

  /// @param motion base_link(previous) ← base_link(this); the places stay where they are without it
  /// @param undecided_m base_link, where the regions of this frame begin
  /// @param objects of the same frame: what they cover as often as it was undecided is decided
  void take(const Motion& motion, const std::vector<Eigen::Vector2d>& undecided_m,
            const std::vector<ObjectObservation>& objects);

  /// Places, base_link of the last frame, to be told now: seen in kLasting frames and not told before. With
  /// `ended` those, too, that were seen in half of their frames, and in three at least. Valid until the next
  /// call.
  const std::vector<Eigen::Vector2d>& toTell(bool ended = false);

  static constexpr int kLasting = 10;

 private:
  struct Place {
    Eigen::Vector2d at_m;
    int frames = 0;   ///< since it was first seen
    int seen = 0;     ///< in so many of them
    int unseen = 0;   ///< since it was last seen
    int covered = 0;  ///< frames in which an object was there instead
    bool is_told = false;
  };
  std::vector<Place> places_;
  std::vector<Eigen::Vector2d> told_m_;
};

}  // namespace omnifleet::local_mapper
