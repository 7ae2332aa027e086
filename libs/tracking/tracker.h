#pragma once

#include <Eigen/Core>
#include <vector>

#include "tracking/own_motion.h"
#include "tracking/peers.h"
#include "tracking/track_state.h"

namespace omnifleet::tracking {

struct TrackerOptions {
  PrismFilterOptions filter;
  double gate_m = 0.25;             ///< m, typical distance of outlines beyond which a blob is another object
  double merged_solidity = 0.94;    ///< 1, below it a blob is not one convex object (RECIPES)
  double cut_margin_m = 0.02;       ///< m, how far an outline must stand out to be this object's own
  double keep_s = 5.0;              ///< s, an unseen object is carried on
  double keep_hidden_s = 15.0;      ///< s, likewise while something stands before it
  double keep_new_s = 0.5;          ///< s, likewise if it was seen fewer than three times
  double max_contact_m = 4.0;       ///< m, blobs farther away start no track
  double gap_sigma_m = 0.3;         ///< m, how far the robot may have gone across a gap
  double history_s = 3.0;           ///< s, views kept for the motion over the floor

  static TrackerOptions read(const options::Section& section);
};

/// Objects followed by one robot. A frame is predict → associate → split → update → end, in this order.
class Tracker {
 public:
  explicit Tracker(const TrackerOptions& options) : options_(options) {}

  /// Every object to this frame's time. `continuous` is false across a gap.
  void predict(const OwnMotion& own, bool continuous);
  /// Which blob is which track: Hungarian over the typical distance between the blob's outline and the outline that
  /// the track should show from here. `assignment` by blob; tracks swallowed by another's blob join it.
  void associate(const LocalMap& local_map, const OwnMotion& own, const std::vector<Peer>& peers);
  /// Filters take in their own directions, new tracks start, lost ones end.
  void update(const LocalMap& local_map, const OwnMotion& own);

  std::vector<TrackState>& tracks() { return tracks_; }
  const std::vector<TrackState>& tracks() const { return tracks_; }
  /// This frame's tracks as published, in base_link.
  void write(const LocalMap& local_map, const OwnMotion& own, std::vector<Track>& out) const;

 private:
  TrackerOptions options_;
  std::vector<TrackState> tracks_;
  std::uint32_t next_id_ = 1;
  std::vector<View> views_;                  ///< of this frame's blobs
  std::vector<std::vector<int>> owners_;     ///< tracks in each blob
  Eigen::MatrixXd cost_;
};

}  // namespace omnifleet::tracking
