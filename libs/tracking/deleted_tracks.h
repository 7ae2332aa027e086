#pragma once

#include <optional>
#include <vector>

#include "tracking/track_state.h"

namespace omnifleet::tracking {

/// Ratio between the distance from the place where an object was last seen (`place_m`, odom) to the detection
/// `seen`, and the distance that the object can have travelled in `unseen_s`. The object moved at `speed_mps`
/// when it was last seen. A ratio up to 1 is plausible. Infinity if the object stood still, or if width or
/// height of the detection differ.
double travelRatio(const PrismFilter& object, const Eigen::Vector2d& place_m, double speed_mps,
                   double unseen_s, const PrismFilter& seen);

/// Tracks that the tracker has deleted. A new detection at the place of a deleted track, or within the
/// distance that the object can have travelled unseen, continues that track: it keeps the id and the evidence
/// for its kind.
class DeletedTracks {
 public:
  DeletedTracks() { entries_.reserve(kMost); }
  struct Entry {
    std::uint32_t id;
    KindEvidence evidence;
    ObjectKind kind;
    double kind_probability;
    PrismFilter filter;
    Eigen::Vector2d place_m;  ///< odom, when it was last seen
    double speed_mps;         ///< when it was last seen
    TimeNs seen_ns;
    bool stood;  ///< a stationary obstacle that no robot pushed: kept at its place for 60 s
  };

  /// Adds a track. Tracks of robots that publish their pose are not added: the pose identifies them.
  void add(const TrackState& track);
  /// Removes and returns the entry that matches `seen`: last seen within `gate_m` of it, or able to have
  /// travelled there, at most `keep_s` ago. Returns nothing without a match.
  std::optional<Entry> take(const PrismFilter& seen, double gate_m, TimeNs now_ns, double keep_s);
  /// Clears all entries: across a gap in the odometry the stored places are invalid.
  void forget() { entries_.clear(); }

 private:
  static constexpr std::size_t kMost = 32;
  std::vector<Entry> entries_;  ///< oldest first
};

}  // namespace omnifleet::tracking
