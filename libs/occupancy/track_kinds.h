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

/// What each robot's tracks are known to be, whenever that was learned: the latest decided kind among all
/// contributions of that robot, overruled by a judgement. Tracks go by the low 16 bits that scans carry.
class TrackKinds {
 public:
  using Track = std::pair<std::string, std::uint16_t>;

  /// Takes in what a contribution says; returns whether the kind of any of its tracks changed.
  bool learn(const Contribution& contribution);
  /// Returns the robots whose tracks changed.
  std::set<std::string> judge(const std::map<std::pair<std::string, std::uint32_t>, ObjectKind>& kinds);
  /// What all contributions of a store say, with the same judgement.
  TrackKinds rebuilt(const ContributionStore& store) const;
  ObjectKind kindOf(const std::string& robot, std::uint16_t track) const;
  /// Judged to be unknown: nothing that stands in the way, whatever the contributions say.
  bool isMark(const std::string& robot, std::uint16_t track) const;

 private:
  struct Said {
    TimeNs latest_ns;
    ObjectKind kind;
  };
  std::map<Track, Said> said_;
  std::map<Track, ObjectKind> judged_;
};

/// One role per ray of a contribution, given its pose's sightings (rays at robots are left out).
std::vector<RayRole> rolesOf(const Contribution& contribution, const std::vector<Sighting>& sightings,
                             const TrackKinds& kinds, bool unknown_is_hit);

}  // namespace omnifleet::occupancy
