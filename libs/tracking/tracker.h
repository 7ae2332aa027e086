#pragma once

#include <Eigen/Core>
#include <vector>

#include "tracking/deleted_tracks.h"
#include "tracking/outline_split.h"
#include "tracking/own_motion.h"
#include "tracking/peers.h"
#include "tracking/track_state.h"

namespace omnifleet::tracking {

struct TrackerOptions {
  PrismFilterOptions filter;
  double gate_m = 0.25;           ///< m, typical distance of outlines from which a blob is another object
  double merged_solidity = 0.94;  ///< 1, a blob with a lower solidity is not one convex object
  double cut_margin_m =
      0.02;             ///< m, by which the outline of an object must exceed the others in its directions
  double keep_s = 5.0;  ///< s, an unseen object is kept this long
  double keep_hidden_s =
      15.0;                 ///< s, an unseen object is kept this long while hidden; stationary obstacles too
  double keep_new_s = 0.5;  ///< s, an unseen object with fewer than three views is kept this long
  double max_contact_m = 4.0;  ///< m, blobs whose contact is farther away start no track
  double gap_sigma_m = 0.3;    ///< m, σ of the robot's displacement across a gap
  double locate_sigma_m =
      0.08;  ///< m, an object never seen alone is published when σ of its place falls below this
  double lose_sigma_m = 0.15;  ///< m, it is no longer published when σ exceeds this
  double composite_m =
      0.30;                ///< m, a non-convex object with a larger mean radius is treated as several objects
  bool pieces = true;      ///< match pieces of peers (no key)
  double history_s = 3.0;  ///< s, views kept to measure the motion over the floor

  static TrackerOptions read(const options::Section& section);
};

/// Tracks the objects around one robot. A frame is predict → associate → update, in this order.
class Tracker {
 public:
  explicit Tracker(const TrackerOptions& options) : options_(options) {}

  /// Predicts every object to this frame's time. `continuous` is false across a gap.
  void predict(const OwnMotion& own, bool continuous);
  /// Marks every object as not visible and keeps it: nothing is known of this frame, not even the own motion.
  void markUnseen();
  /// Assigns blobs to tracks with the Hungarian method. The cost is the typical distance between the blob's
  /// outline and the outline predicted for the track. An unassigned track whose outline lies within another
  /// track's blob joins that blob. A peer whose published place lies within a merged blob starts a track if
  /// none is there. Sets Peer::in_blob.
  void associate(const LocalMap& local_map, const OwnMotion& own, std::vector<Peer>& peers);
  /// Updates the filters with the directions that belong to them, starts new tracks and deletes lost ones. A
  /// peer of which the camera separates only pieces from the floor, or detects only an undecided object, is
  /// updated at its published place.
  void update(const LocalMap& local_map, const OwnMotion& own, const std::vector<Peer>& peers);

  std::vector<TrackState>& tracks() { return tracks_; }
  /// The track of the blob that is nearest to the end point of a ray; nullptr where the blob started none.
  const TrackState* trackAt(std::size_t blob, const Eigen::Vector2d& point_in_odom) const;
  /// Writes this frame's tracks in base_link. With an invalid local map all are not visible.
  void write(const LocalMap& local_map, const OwnMotion& own, std::vector<Track>& out) const;

 private:
  /// Observation of a peer whose pose is published.
  struct PeerObservation {
    bool whole = false;      ///< a blob has its outline
    int blob = -1;           ///< the piece of it whose contact is nearest; −1: none
    bool undecided = false;  ///< the scan is undecided at its place
    View outline;            ///< encloses its pieces
  };
  void makeViews(const LocalMap& local_map, const OwnMotion& own);
  void assignBlobs();
  void joinEnclosingBlob(const LocalMap& local_map, int track);
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
  void updateAlone(TrackState& track, const View& view, const ObjectObservation& object,
                   const OwnMotion& own);
  void updateTrack(TrackState& track, const View& view, const ObjectObservation& object);
  void writePoints(const LocalMap& local_map, const OwnMotion& own, std::vector<Track>& out) const;
  bool isPieceOfKnown(const PrismFilter& piece) const;
  int lostAt(const PrismFilter& filter, const View& view, bool rest_of_blob = false) const;
  void lookForPeers(const LocalMap& local_map, std::vector<Peer>& peers);
  bool isOfAnObject(const View& view) const;
  int trackOf(std::size_t peer) const;
  int startTrackOf(const Peer& peer, std::size_t number);
  void updatePieces(const LocalMap& local_map, const std::vector<Peer>& peers);
  void updateInPieces(TrackState& track, const Peer& peer, const PeerObservation& seen,
                      const LocalMap& local_map);
  void placeAsPublished(TrackState& track, TimeNs now_ns);
  static void recordSighting(TrackState& track, TimeNs now_ns);
  static void reappear(TrackState& track, const PrismFilter& seen);
  static TrackState::Published publishedBy(const Peer& peer);
  bool isShown(const TrackState& track) const {
    return track.partly_seen || (track.blob >= 0 && (track.clean || track.located));
  }
  void followPeers(const std::vector<Peer>& peers);
  void end();

  TrackerOptions options_;
  std::vector<TrackState> tracks_;
  DeletedTracks deleted_tracks_;
  /// Published place of each peer, and the id of its track; 0: none yet.
  struct KnownPeer {
    std::uint32_t id = 0;
    bool known = false;
    Eigen::Vector2d centre_m;  ///< odom
    double sigma_m;
  };
  std::vector<KnownPeer> known_peers_;
  std::uint32_t next_id_ = 1;
  std::vector<PeerObservation> peer_observations_;
  std::vector<int> piece_of_;  ///< by blob: the peer that it is a piece of; −1: none
  View eye_;                   ///< viewpoint of this frame; its supports only give the number of directions
  std::vector<View> views_;    ///< of this frame's blobs
  std::vector<std::vector<int>> owners_;  ///< tracks in each blob
  Eigen::MatrixXd cost_, open_cost_;
  std::vector<int> known_owners_;
  std::vector<BlobOwner> split_owners_;
  std::vector<View> split_;
  View rest_;
};

}  // namespace omnifleet::tracking
