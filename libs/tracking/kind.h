#pragma once

#include <vector>

#include "options/options.h"
#include "tracking/peers.h"
#include "tracking/track_state.h"

namespace omnifleet::tracking {

struct KindOptions {
  std::string method = "ours";  ///< ours | choi (vectors only)
  double fit_rms_m = 0.05;      ///< m, a known body that fits better is a robot
  double moved_m = 0.12;        ///< m over the floor within `window_s`
  double window_s = 1.0;        ///< s
  double slow_window_s = 3.0;   ///< s, in which what crawls has gone `moved_m` (no more than history_s)
  double still_m = 0.04;        ///< m over the floor within `window_s`: it stands
  double peer_gate_m = 0.25;    ///< m, a published pose this near (or within 3 σ) is this object
  double shape_range_m = 3.2;   ///< m, contact farther away tells no shape
  double push_gap_m = 0.08;     ///< m, what moves this close to a robot may be pushed by it
  double decide = 0.80;         ///< probability from which an undecided object is named
  double change = 0.90;         ///< probability from which a named object is renamed
  int change_frames = 3;        ///< frames in a row before it is renamed

  static KindOptions read(const options::Section& section);
};

/// Robot, obstacle or not yet known: log-odds of robot, in natural units, summed over three kinds of
/// evidence. Shape: the best fit of any known body, averaged over views in which it stood alone. Place: a
/// peer's published pose says it stands here (robot); or no more robots are missing hereabouts than likelier
/// objects are there (it merely looks like one). Motion: it went more than 12 cm over the floor within a
/// second, or within three and still goes on, by the contact side of its outline, which needs no height, both
/// by odometry, which drifts, and by our own published poses, which jump; once moved, a robot stays one while
/// its shape allows it. What moves on its own is a robot whatever its shape; what does not clearly fit a body
/// and moves only in touch with a robot (or with us) is an obstacle being pushed. Hysteresis: a label is
/// given at `decide`, taken back at `change` and after some frames, at once for what is seen in one piece to
/// drive, and where `decide` has spoken against it for the whole window. What has the shape of a robot where
/// none of the fleet can be stays undecided until its motion had time to tell.
class KindJudge {
 public:
  KindJudge(const KindOptions& options, double own_radius_m)
      : options_(options), own_radius_m_(own_radius_m) {}

  /// Takes in this frame's evidence for every track and settles its kind. `local_map` must be valid.
  void judge(std::vector<TrackState>& tracks, const std::vector<Peer>& peers, const LocalMap& local_map,
             const OwnMotion& own);

 private:
  void judgeMotion(TrackState& track, const std::vector<TrackState>& tracks, const OwnMotion& own) const;
  void judgeShape(TrackState& track, const std::vector<Peer>& peers, const OwnMotion& own) const;
  void judgePlaces(std::vector<TrackState>& tracks, const std::vector<Peer>& peers,
                   const OwnMotion& own) const;
  void weighPlaces(std::vector<TrackState>& tracks, const std::vector<Peer>& peers,
                   const std::vector<const Peer*>& missing, double rate) const;
  void settle(TrackState& track, const std::vector<Peer>& peers, double step_s) const;
  void settleByVectors(TrackState& track, const LocalMap& local_map) const;
  bool touchesRobot(const TrackState& track, const std::vector<TrackState>& tracks,
                    const OwnMotion& own) const;

  KindOptions options_;
  double own_radius_m_;
};

}  // namespace omnifleet::tracking
