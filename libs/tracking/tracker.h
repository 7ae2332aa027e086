#pragma once

#include <Eigen/Core>
#include <vector>

#include "tracking/given_up.h"
#include "tracking/outline_split.h"
#include "tracking/own_motion.h"
#include "tracking/peers.h"
#include "tracking/track_state.h"

namespace omnifleet::tracking {

struct TrackerOptions {
  PrismFilterOptions filter;
  double gate_m = 0.25;           ///< m, typical distance of outlines beyond which a blob is another object
  double merged_solidity = 0.94;  ///< 1, below it a blob is not one convex object
  double cut_margin_m = 0.02;     ///< m, how far an outline must stand out to be this object's own
  double keep_s = 5.0;            ///< s, an unseen object is carried on
  double keep_hidden_s = 15.0;    ///< s, likewise while something stands before it, and what stands itself
  double keep_new_s = 0.5;        ///< s, likewise if it was seen fewer than three times
  double max_contact_m = 4.0;     ///< m, blobs farther away start no track
  double gap_sigma_m = 0.3;       ///< m, how far the robot may have gone across a gap
  double locate_sigma_m = 0.08;   ///< m, σ of the place from which what was never alone is shown …
  double lose_sigma_m = 0.15;     ///< m, … and beyond which it is no longer
  double composite_m = 0.30;      ///< m, mean radius from which it is several things if it is not convex
  bool pieces = true;             ///< peers are told from pieces, too (no key)
  double history_s = 3.0;         ///< s, views kept for the motion over the floor

  static TrackerOptions read(const options::Section& section);
};

/// Objects followed by one robot. A frame is predict → associate → split → update → end, in this order.
class Tracker {
 public:
  explicit Tracker(const TrackerOptions& options) : options_(options) {}

  /// Every object to this frame's time. `continuous` is false across a gap.
  void predict(const OwnMotion& own, bool continuous);
  /// Nothing is known of this frame, not even the own motion: every object stays, none is visible.
  void unsee();
  /// Which blob is which track: Hungarian over the typical distance between the blob's outline and the
  /// outline that the track should show from here. Tracks left over that another's blob has swallowed join
  /// it.
  /// A peer whose published place lies within a merged blob, where no track is, starts one. Sets
  /// Peer::in_blob.
  void associate(const LocalMap& local_map, const OwnMotion& own, std::vector<Peer>& peers);
  /// Filters take in the directions that are their own, new tracks start, lost ones end. Peers of which but
  /// pieces are told from the floor, or that something is there, are seen where they say they are.
  void update(const LocalMap& local_map, const OwnMotion& own, const std::vector<Peer>& peers);

  std::vector<TrackState>& tracks() { return tracks_; }
  /// The track that a ray ending at a point of a blob has hit; nullptr where the blob started none.
  const TrackState* trackAt(std::size_t blob, const Eigen::Vector2d& point_in_odom) const;
  /// This frame's tracks as published, in base_link. An invalid local map shows none of them.
  void write(const LocalMap& local_map, const OwnMotion& own, std::vector<Track>& out) const;

 private:
  /// How a peer is seen whose place is published.
  struct PeerInSight {
    bool whole = false;      ///< a blob has its outline
    int blob = -1;           ///< the piece of it that touches the floor nearest; −1: none
    bool undecided = false;  ///< something is there
    View outline;            ///< around its pieces
  };
  void lookAt(const LocalMap& local_map, const OwnMotion& own);
  void assignBlobs();
  void joinSwallowing(const LocalMap& local_map, int track);
  void joinPeers(std::vector<Peer>& peers);
  void startPeer(const Peer& peer, std::size_t number, std::size_t blob);
  bool isOwn(const TrackState& track, const View& view) const;
  bool showsMore(const TrackState& track, const View& view) const;
  void findOwners(std::size_t blob, int& vague);
  void updateMerged(const ObjectObservation& object, std::size_t blob);
  void dissolveOverlaps(std::size_t blob);
  void updateRest(const ObjectObservation& object, std::size_t blob, int vague, int alien);
  void addTrack(const PrismFilter& filter, TimeNs now_ns);
  std::optional<std::uint32_t> idOfPeerAt(const Eigen::Vector2d& place_m) const;
  bool isFollowed(std::uint32_t id) const;
  PrismFilter freshRest() const;
  PrismFilter fresh(const ObjectObservation& object, const View& view, const OwnMotion& own) const;
  void start(const ObjectObservation& object, std::size_t blob, const View& view, const OwnMotion& own,
             bool whole);
  void seeAlone(TrackState& track, const View& view, const ObjectObservation& object, const OwnMotion& own);
  void see(TrackState& track, const View& view, const ObjectObservation& object);
  void writePoints(const LocalMap& local_map, const OwnMotion& own, std::vector<Track>& out) const;
  bool isPieceOfKnown(const PrismFilter& piece) const;
  int lostAt(const PrismFilter& filter, const View& view, bool rest_of_blob = false) const;
  void lookForPeers(const LocalMap& local_map, std::vector<Peer>& peers);
  bool isOfAThing(const View& view) const;
  int trackOf(std::size_t peer) const;
  int startTrackOf(const Peer& peer, std::size_t number);
  void seePieces(const LocalMap& local_map, const std::vector<Peer>& peers);
  void glimpse(TrackState& track, const Peer& peer, const PeerInSight& seen, const LocalMap& local_map);
  void glimpseAsPublished(TrackState& track, TimeNs now_ns);
  static void noteSight(TrackState& track, TimeNs now_ns);
  static void comeOut(TrackState& track, const PrismFilter& seen);
  static TrackState::Published publishedBy(const Peer& peer);
  bool isShown(const TrackState& track) const {
    return track.glimpsed || (track.blob >= 0 && (track.clean || track.located));
  }
  void followPeers(const std::vector<Peer>& peers);
  void end();

  TrackerOptions options_;
  std::vector<TrackState> tracks_;
  GivenUp given_up_;
  /// Where each peer says it is, and the id that it had; 0: none yet.
  struct KnownPeer {
    std::uint32_t id = 0;
    bool known = false;
    Eigen::Vector2d centre_m;  ///< odom
    double sigma_m;
  };
  std::vector<KnownPeer> known_peers_;
  std::uint32_t next_id_ = 1;
  std::vector<PeerInSight> sights_;
  std::vector<int> piece_of_;             ///< by blob: the peer of which it is a piece; −1: of none
  View eye_;                              ///< from where this frame was taken; its supports tell nothing
  std::vector<View> views_;               ///< of this frame's blobs
  std::vector<std::vector<int>> owners_;  ///< tracks in each blob
  Eigen::MatrixXd cost_, open_cost_;
  std::vector<int> known_owners_;
  std::vector<BlobOwner> split_owners_;
  std::vector<View> split_;
  View rest_;
};

}  // namespace omnifleet::tracking
