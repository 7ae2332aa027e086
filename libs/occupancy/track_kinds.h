#pragma once

#include <cstdint>
#include <map>
#include <set>
#include <string>
#include <utility>
#include <vector>

#include "occupancy/contribution_store.h"
#include "occupancy/ray_window.h"

namespace omnifleet::occupancy {

/// Kinds of each robot's tracks, independent of when they became known: the latest decided kind among all
/// contributions of that robot, unless overridden. Tracks are identified by the low 16 bits of their id, as
/// in scans.
class TrackKinds {
 public:
  using Track = std::pair<std::string, std::uint16_t>;

  /// Adds the kinds that a contribution reports. Returns true if the kind of any of its tracks changed.
  bool learn(const Contribution& contribution);
  /// Replaces the overrides. Returns the robots whose tracks changed.
  std::set<std::string> overrideKinds(
      const std::map<std::pair<std::string, std::uint32_t>, ObjectKind>& kinds);
  /// Kinds from all contributions of a store, with the same overrides.
  TrackKinds rebuilt(const ContributionStore& store) const;
  ObjectKind kindOf(const std::string& robot, std::uint16_t track) const;
  /// Overridden to unknown: a floor marking, which is no obstacle, whatever the contributions report.
  bool isFloorMarking(const std::string& robot, std::uint16_t track) const;

 private:
  struct Report {
    TimeNs latest_ns;
    ObjectKind kind;
  };
  std::map<Track, Report> reported_;
  std::map<Track, ObjectKind> overrides_;
};

/// One role per ray of a contribution, given the sightings of its pose. Rays at robots have no effect.
std::vector<RayRole> rolesOf(const Contribution& contribution, const std::vector<Sighting>& sightings,
                             const TrackKinds& kinds, bool unknown_is_hit);

}  // namespace omnifleet::occupancy
