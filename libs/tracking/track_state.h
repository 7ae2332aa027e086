#pragma once

#include <cmath>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "tracking/body_fit.h"
#include "tracking/prism_filter.h"
#include "tracking/remembered_outline.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

/// Evidence of one object's kind so far, as log-odds of being a robot.
struct KindEvidence {
  double shape = 0.0, place = 0.0, motion = 0.0;
  int shape_views = 0;      ///< clean views that went into `shape`
  int best_body = -1;       ///< index of the peer whose body fits best
  int peer = -1;            ///< index of the peer whose published pose matches
  int against = 0;          ///< frames that speak for another label with probability ≥ `change`
  double against_s = 0.0;   ///< seconds of frames that speak for another label with probability ≥ `decide`
  double still_s = 0.0;     ///< time for which it has stood still, seconds
  double touching_s = 1e9;  ///< time since it last touched a robot, seconds
  int moved_frames = 0;     ///< frames in a row in which it moved
  double drives_s = 0.0;    ///< seconds of uninterrupted motion without recent contact with a robot
  bool drove = false;       ///< `drives_s` was once long enough to exclude a pushed object
  bool pushed = false;      ///< its motion is attributed to a robot beside it
};

/// One tracked object between frames. All places are in `odom` (own_motion.h).
struct TrackState {
  TrackState(std::uint32_t id_, const PrismFilter& filter_) : id(id_), filter(filter_) {}

  std::uint32_t id;
  PrismFilter filter;
  ObjectKind kind = ObjectKind::kUnknown;
  double kind_probability = 0.0;
  KindEvidence evidence;
  bool moving = false;
  int identity = -1;  ///< index of the peer whose published pose matched when it was last seen; −1: none
  /// Published place of that peer now (odom). It serves where the own outline does not, in a blob with other
  /// objects.
  struct Published {
    Eigen::Vector2d centre_m, velocity_mps;
    Eigen::Matrix2d covariance;
    const BodyModel* body;  ///< of the peer, valid during this frame

    double sigma() const { return std::sqrt(0.5 * covariance.trace()); }
    /// True if the filter's place contradicts the published one: their distance exceeds `sigmas` times σ.
    bool contradicts(const PrismFilter& filter, double sigmas = 3.0) const {
      return (filter.position() - centre_m).norm() > sigmas * sigma();
    }
  };
  std::optional<Published> published;

  int views = 0;          ///< frames in which it was visible
  TimeNs seen_ns = 0;     ///< time of the last of them
  double unseen_s = 0.0;  ///< seconds since then
  bool hidden = false;    ///< not visible, but an object stands in front of it
  bool whole = false;  ///< it was seen alone in its blob, or its body is known: its outline can be predicted
  bool located = false;    ///< its place is known; the far edge of a merged blob alone does not determine it
  bool dissolved = false;  ///< it was several objects, which now have tracks of their own
  int unexplained_frames = 0;  ///< frames in a row in which its blob exceeded the predicted outlines
  int blob = -1;               ///< index into this frame's objects; −1: not visible
  bool partly_seen = false;    ///< this frame shows only pieces of it, or an undecided object at its place
  double age_s = 0.0;          ///< seconds since it was first seen
  bool clean = false;          ///< in this frame alone in its blob, not truncated
  View view;                   ///< this frame's view; σ ≤ 0 in directions that belong to other objects
  /// A view of the last seconds, and the estimated place of the object at that time (odom).
  struct Past {
    View view;
    Eigen::Vector2d centre_m;
  };
  std::deque<Past> past;      ///< oldest first
  RememberedOutline outline;  ///< of its blob while the blob belonged to this track alone
  Eigen::Vector2d last_seen_m = Eigen::Vector2d::Zero();  ///< place where it was last seen, odom
  double last_speed_mps = 0.0;                            ///< speed when it was last seen in one piece
  /// Resets all but the id: the previous estimates belong to another object.
  void restart(const PrismFilter& fresh) {
    filter = fresh;
    evidence = KindEvidence{};
    kind = ObjectKind::kUnknown;
    kind_probability = 0.0;
    past.clear();
    moving = true;
  }
  void dissolve() {
    dissolved = true;
    blob = -1;
  }
  bool isSeen() const { return blob >= 0 || partly_seen; }
  double positionSigma() const { return std::sqrt(0.5 * filter.positionCovariance().trace()); }

  BodyFit fit;  ///< best known body for this view
};

}  // namespace omnifleet::tracking
