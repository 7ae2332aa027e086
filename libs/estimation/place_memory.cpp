#include "estimation/place_memory.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::estimation {

void PlaceMemory::note(std::uint32_t index) {
  if (std::find(changed_.begin(), changed_.end(), index) == changed_.end()) changed_.push_back(index);
}

void PlaceMemory::add(Place place, const std::optional<Id>& keyframe, const KeyframeMap& map,
                      const Eigen::Matrix3d& covariance) {
  place.index = static_cast<std::uint32_t>(places_.size());
  if (!places_.empty()) {
    const Place& before = places_.back();
    place.links.insert(place.links.begin(),
                       PlaceLink{false, place.robot, before.index,
                                 place.frame_from_base.inverse() * before.frame_from_base, covariance});
  }
  Anchor anchor;
  anchor.keyframe = keyframe;
  if (keyframe) anchor.keyframe_from_base = map.pose(*keyframe).inverse() * place.frame_from_base;
  note(place.index);
  places_.push_back(std::move(place));
  anchors_.push_back(anchor);
}

void PlaceMemory::linkNewest(const PlaceLink& link) {
  if (places_.empty()) return;
  places_.back().links.push_back(link);
  note(places_.back().index);
}

void PlaceMemory::follow(const KeyframeMap& map, double moved_m, double moved_rad) {
  for (std::size_t i = 0; i < places_.size(); ++i) {
    if (!anchors_[i].keyframe) continue;
    const Pose2 now = map.pose(*anchors_[i].keyframe) * anchors_[i].keyframe_from_base,
                by = places_[i].frame_from_base.inverse() * now;
    if (by.translation().norm() <= moved_m && std::abs(by.theta_rad) <= moved_rad) continue;
    places_[i].frame_from_base = now;
    note(static_cast<std::uint32_t>(i));
  }
}

void PlaceMemory::append(const PlaceMemory& other, Id first, const Pose2& map_from_other,
                         const KeyframeMap& map) {
  const auto offset = static_cast<std::uint32_t>(places_.size());
  for (std::size_t i = 0; i < other.places_.size(); ++i) {
    Place place = other.places_[i];
    Anchor anchor = other.anchors_[i];
    place.index += offset;
    for (PlaceLink& link : place.links)
      if (link.robot == place.robot) link.index += offset;
    if (anchor.keyframe) *anchor.keyframe += first;
    place.frame_from_base = anchor.keyframe ? map.pose(*anchor.keyframe) * anchor.keyframe_from_base
                                            : map_from_other * place.frame_from_base;
    note(place.index);
    places_.push_back(std::move(place));
    anchors_.push_back(anchor);
  }
}

PlaceMemory PlaceMemory::withoutKeyframes() const {
  PlaceMemory copy = *this;
  for (Anchor& anchor : copy.anchors_) anchor.keyframe.reset();
  return copy;
}

std::vector<std::uint32_t> PlaceMemory::takeChanged() {
  std::vector<std::uint32_t> changed = std::exchange(changed_, {});
  std::sort(changed.begin(), changed.end());
  return changed;
}

}  // namespace omnifleet::estimation
