#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

#include "estimation/keyframe_map.h"
#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::estimation {

/// The places of one robot: nodes of the topological map (Fernández et al. 2011 §IV.A), each relative to a
/// keyframe if its scan met one, so that a closed loop moves it exactly.
class PlaceMemory {
 public:
  using Id = KeyframeMap::Id;

  /// A new place. Its index and its link to the place before are set here. @param from_before its pose
  /// relative to that place by the robot's motion @param covariance of it
  void add(Place place, const std::optional<Id>& keyframe, const KeyframeMap& map,
           const Eigen::Matrix3d& covariance);
  /// Links the newest place to another one that closes a loop.
  void linkNewest(const PlaceLink& link);

  /// Places whose keyframes have moved by more than the bounds (m, rad) since they were published move along.
  void follow(const KeyframeMap& map, double moved_m, double moved_rad);
  /// Takes over the places of another memory whose keyframes now begin at `first`. Places without a keyframe
  /// are moved by map_from_other.
  void append(const PlaceMemory& other, Id first, const Pose2& map_from_other, const KeyframeMap& map);

  /// The same places, none of them relative to a keyframe.
  PlaceMemory withoutKeyframes() const;

  const std::vector<Place>& places() const { return places_; }
  /// The keyframe that a place is relative to.
  const std::optional<Id>& keyframe(std::uint32_t index) const { return anchors_[index].keyframe; }
  /// Indices of the places that are new or have moved since the last call, ascending.
  std::vector<std::uint32_t> takeChanged();

 private:
  struct Anchor {
    std::optional<Id> keyframe;
    Pose2 keyframe_from_base;
  };
  void note(std::uint32_t index);

  std::vector<Place> places_;
  std::vector<Anchor> anchors_;
  std::vector<std::uint32_t> changed_;
};

}  // namespace omnifleet::estimation
