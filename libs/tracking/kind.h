#pragma once

#include <vector>

#include "options/options.h"
#include "tracking/peers.h"
#include "tracking/track_state.h"

namespace omnifleet::tracking {

struct KindOptions {
  std::string method = "log_odds";  ///< log_odds | vectors (Choi §IV.2: vectors alone)
  double fit_rms_m = 0.05;          ///< m, a known body that fits better is a robot
  double moved_m = 0.12;            ///< m over the floor within `window_s`
  double window_s = 1.0;            ///< s
  double slow_window_s = 3.0;       ///< s, a slow object moves `moved_m` within this time (at most history_s)
  double still_m = 0.04;       ///< m over the floor within `window_s`; an object that moves less stands still
  double peer_gate_m = 0.25;   ///< m, a published pose this near (or within 3 σ) is this object
  double shape_range_m = 3.2;  ///< m, an object whose centre is farther away gives no shape evidence
  double push_gap_m = 0.08;    ///< m, an object that moves this close to a robot may be pushed by it
  double decide = 0.80;        ///< probability from which an undecided object gets a label
  double change = 0.90;        ///< probability from which the label changes
  int change_frames = 3;       ///< frames in a row before the label changes

  static KindOptions read(const options::Section& section);
};

/// Classifies each object as robot, obstacle or unknown by the log-odds (natural units) of being a robot, the
/// sum of three kinds of evidence.
/// Shape: the best fit of any known body, averaged over views in which the object is alone in its blob.
/// Place: positive if the published pose of a peer lies at the object. Negative if every robot that may be
/// near is accounted for, or if enough other objects are more likely to be the missing robots.
/// Motion: the object moves more than `moved_m` over the floor within `window_s`, or within `slow_window_s`
/// and is still moving. The contact side of the outline measures the motion, which needs no height. The
/// motion must show both in odometry, which drifts, and in the published poses of this robot, which jump.
/// After a motion the object stays a robot as long as its shape allows it.
/// An object that moves on its own is a robot, whatever its shape. An object that does not clearly fit a
/// body, and moves only in contact with a robot (or with this robot), is a pushed obstacle.
/// Hysteresis: a label is given at `decide`. It changes at `change` after `change_frames` frames, at once for
/// an object that is seen in one piece and moving, or after `decide` has been reached against it for
/// `window_s`. An object with the shape of a robot, where no robot of the fleet can be, stays undecided for
/// `window_s`, so that its motion can decide.
class KindJudge {
 public:
  KindJudge(const KindOptions& options, double own_radius_m)
      : options_(options), own_radius_m_(own_radius_m) {}

  /// Adds the evidence of this frame to every track and updates its kind. `local_map` must be valid.
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
