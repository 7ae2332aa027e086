#include "occupancy/track_kinds.h"

#include <algorithm>

namespace omnifleet::occupancy {

bool TrackKinds::learn(const Contribution& contribution) {
  bool changed = false;
  for (const auto& view : contribution.views) {
    if (view.kind == ObjectKind::kUnknown) continue;
    const Track track{contribution.robot, static_cast<std::uint16_t>(view.track_id)};
    const auto found = reported_.find(track);
    if (found != reported_.end() && found->second.latest_ns >= contribution.acquired_ns) continue;
    changed = changed || found == reported_.end() || found->second.kind != view.kind;
    reported_[track] = {contribution.acquired_ns, view.kind};
  }
  return changed;
}

std::set<std::string> TrackKinds::overrideKinds(
    const std::map<std::pair<std::string, std::uint32_t>, ObjectKind>& kinds) {
  std::map<Track, ObjectKind> overrides;
  for (const auto& [name, kind] : kinds)
    overrides[{name.first, static_cast<std::uint16_t>(name.second)}] = kind;
  std::set<std::string> robots;
  for (const auto* side : {&overrides, &overrides_}) {
    const auto& other = side == &overrides ? overrides_ : overrides;
    for (const auto& [track, kind] : *side) {
      const auto found = other.find(track);
      if (found == other.end() || found->second != kind) robots.insert(track.first);
    }
  }
  overrides_ = std::move(overrides);
  return robots;
}

TrackKinds TrackKinds::rebuilt(const ContributionStore& store) const {
  TrackKinds fresh;
  fresh.overrides_ = overrides_;
  for (const auto& [robot, path] : store.robots()) {
    for (const auto& [time_ns, keyframe] : path) {
      if (keyframe.contribution) fresh.learn(*keyframe.contribution);
    }
  }
  return fresh;
}

ObjectKind TrackKinds::kindOf(const std::string& robot, std::uint16_t track) const {
  const auto overridden = overrides_.find({robot, track});
  if (overridden != overrides_.end()) return overridden->second;
  const auto reported = reported_.find({robot, track});
  return reported == reported_.end() ? ObjectKind::kUnknown : reported->second.kind;
}

bool TrackKinds::isFloorMarking(const std::string& robot, std::uint16_t track) const {
  const auto overridden = overrides_.find({robot, track});
  return overridden != overrides_.end() && overridden->second == ObjectKind::kUnknown;
}

namespace {

struct Known {
  ObjectKind kind = ObjectKind::kUnknown;
  bool sighted = false, is_floor_marking = false, is_tracked = false;
};

RayRole roleOf(RayLabel label, const Known& known, bool unknown_is_hit) {
  if (label == RayLabel::kFloorEnd) return RayRole::kFree;
  if (label == RayLabel::kUndecided) return RayRole::kOpen;
  if (label == RayLabel::kBeyond) return RayRole::kHitBeyond;
  if (label == RayLabel::kUnknown && !known.is_tracked) return RayRole::kHitOnly;
  if (known.sighted || label == RayLabel::kRobot || known.kind == ObjectKind::kRobot) return RayRole::kNone;
  if (known.is_floor_marking) return RayRole::kOpen;
  const bool is_obstacle = label == RayLabel::kObstacle || known.kind == ObjectKind::kObstacle;
  return is_obstacle || unknown_is_hit ? RayRole::kHit : RayRole::kOpen;
}

}  // namespace

std::vector<RayRole> rolesOf(const Contribution& contribution, const std::vector<Sighting>& sightings,
                             const TrackKinds& kinds, bool unknown_is_hit) {
  // Few tracks, many rays: each track is looked up only once.
  std::map<std::uint16_t, Known> tracks;
  const std::size_t count = std::min(contribution.range_dmm.size(), contribution.label.size());
  std::vector<RayRole> roles(count, RayRole::kNone);
  std::uint16_t last = 0;
  Known known;
  for (std::size_t i = 0; i < count; ++i) {
    const RayLabel label = contribution.label[i];
    if (contribution.range_dmm[i] <= 0 || label == RayLabel::kInvalid || label > RayLabel::kBeyond) continue;
    const std::uint16_t track = i < contribution.object.size() ? contribution.object[i] : std::uint16_t{0};
    if (track != last) {
      last = track;
      const auto [found, is_new] = tracks.try_emplace(track);
      if (is_new && track != 0) {
        const bool sighted = std::any_of(sightings.begin(), sightings.end(), [&](const Sighting& s) {
          return static_cast<std::uint16_t>(s.track_id) == track;
        });
        found->second = {kinds.kindOf(contribution.robot, track), sighted,
                         kinds.isFloorMarking(contribution.robot, track), true};
      }
      known = found->second;
    }
    roles[i] = roleOf(label, known, unknown_is_hit);
  }
  return roles;
}

}  // namespace omnifleet::occupancy
