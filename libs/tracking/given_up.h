#pragma once

#include <optional>
#include <vector>

#include "tracking/track_state.h"

namespace omnifleet::tracking {

/// Share of the way that a thing, driving at `speed_mps` when it was last seen at `place_m` (odom), may have
/// gone in `unseen_s` seconds, at which there stands now what is as wide and high as it was; infinity where
/// that is not, or the thing stood.
double wayOn(const PrismFilter& thing, const Eigen::Vector2d& place_m, double speed_mps, double unseen_s,
             const PrismFilter& seen);

/// Tracks that are followed no longer. What comes to light where one of them was, or may have driven unseen,
/// goes on as that one: under its id, and what has spoken for its kind speaks on.
class GivenUp {
 public:
  GivenUp() { entries_.reserve(kMost); }
  struct Entry {
    std::uint32_t id;
    KindEvidence evidence;
    ObjectKind kind;
    double kind_probability;
    PrismFilter filter;
    Eigen::Vector2d place_m;  ///< odom, when it was last seen
    double speed_mps;         ///< likewise
    TimeNs seen_ns;
    bool stood;  ///< an obstacle that nobody pushed: it stays for a minute where it was
  };

  /// Who publishes where it is, is known by that alone: left out.
  void add(const TrackState& track);
  /// Takes out who `seen` was: what was last seen within `gate_m` of it, or may have come there, not more
  /// than `keep_s` ago.
  std::optional<Entry> take(const PrismFilter& seen, double gate_m, TimeNs now_ns, double keep_s);
  /// Nobody knows where the places are now.
  void forget() { entries_.clear(); }

 private:
  static constexpr std::size_t kMost = 32;
  std::vector<Entry> entries_;  ///< oldest first
};

}  // namespace omnifleet::tracking
