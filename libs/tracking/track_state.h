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

/// What one object has shown of its kind so far: log-odds of being a robot.
struct KindEvidence {
  double shape = 0.0, place = 0.0, motion = 0.0;
  int shape_views = 0;      ///< clean views that went into `shape`
  int best_body = -1;       ///< index of the peer whose body fits best
  int peer = -1;            ///< index of the peer whose published pose matches
  int against = 0;          ///< frames in a row that speak for renaming
  double against_s = 0.0;   ///< how long they and less sure ones have
  double still_s = 0.0;     ///< how long it has stood, seconds
  double touching_s = 1e9;  ///< since it last stood against a robot, seconds
  int moved_frames = 0;     ///< frames in a row in which it moved
  double drives_s = 0.0;    ///< how long it has driven without a rest, far from robots, seconds
  bool drove = false;       ///< it once did so for long enough to be no pushed thing
  bool pushed = false;      ///< its motion is put down to a robot beside it
};

/// One followed object between frames. Everything is in `odom` (own_motion.h).
struct TrackState {
  TrackState(std::uint32_t id_, const PrismFilter& filter_) : id(id_), filter(filter_) {}

  std::uint32_t id;
  PrismFilter filter;
  ObjectKind kind = ObjectKind::kUnknown;
  double kind_probability = 0.0;
  KindEvidence evidence;
  bool moving = false;
  int identity = -1;  ///< index of the peer whose published pose it has matched, while it was seen
  /// Where that peer says it is now (odom); speaks where the own outline does not, in a blob with others.
  struct Published {
    Eigen::Vector2d centre_m, velocity_mps;
    Eigen::Matrix2d covariance;
    const BodyModel* body;  ///< of the peer, as long as the frame is

    double sigma() const { return std::sqrt(0.5 * covariance.trace()); }
    /// A robot does not leave the place that it publishes.
    bool isAstray(const PrismFilter& filter, double sigmas = 3.0) const {
      return (filter.position() - centre_m).norm() > sigmas * sigma();
    }
  };
  std::optional<Published> published;

  int views = 0;          ///< frames in which it was seen
  TimeNs seen_ns = 0;     ///< last of them
  double unseen_s = 0.0;  ///< since then
  bool hidden = false;    ///< unseen, but something stands before it
  bool whole =
      false;  ///< has been seen alone in its blob, or its body is known: its outline can be predicted
  bool located =
      false;  ///< its place has become known; a far edge that stands out of a blob does not tell it
  bool dissolved = false;  ///< it was several objects, which are now followed each for itself
  int alien_frames = 0;    ///< frames in a row in which its blob showed more than is known
  int blob = -1;           ///< index into this frame's objects; −1: not seen
  bool glimpsed = false;   ///< this frame shows but pieces of it, or that something is there
  double age_s = 0.0;      ///< since it was first seen
  bool clean = false;      ///< this frame: alone in its blob, whole, not cut
  View view;               ///< this frame's view; directions that are not its own have σ ≤ 0
  /// A view of the last seconds, and where the object was then thought to be (odom).
  struct Past {
    View view;
    Eigen::Vector2d centre_m;
  };
  std::deque<Past> past;                                  ///< oldest first
  RememberedOutline outline;                              ///< of its blob while that was all its own
  Eigen::Vector2d last_seen_m = Eigen::Vector2d::Zero();  ///< odom; where it stood when last seen …
  double last_speed_mps = 0.0;  ///< … and how fast it was when last seen in one piece
  /// Only the id stays: what was known of it was known of something else.
  void startAfresh(const PrismFilter& fresh) {
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
  bool isSeen() const { return blob >= 0 || glimpsed; }
  double positionSigma() const { return std::sqrt(0.5 * filter.positionCovariance().trace()); }

  BodyFit fit;  ///< best known body over this view
};

}  // namespace omnifleet::tracking
