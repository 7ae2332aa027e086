#include "tracking/kind.h"

#include <algorithm>
#include <cmath>

#include "tracking/assignment.h"
#include "tracking/vector_motion.h"

namespace omnifleet::tracking {
namespace {

constexpr double kMovedEvidence = 5.0, kPushedEvidence = -1.0, kStillEvidence = -1.0;
constexpr double kFitEvidence = 3.0, kMisfitEvidence = -4.0;
constexpr double kPeerHereEvidence = 5.0, kPeersElsewhereEvidence = -5.0;
// Two bodies cannot stand in one place. This evidence outweighs a shape that differs from the peer's (another
// object may have merged with it) and the evidence of standing still.
constexpr double kPeerExactlyHereEvidence = 8.0;
constexpr double kPeerMisplacedEvidence =
    -2.0;                              // the object could only be a peer with a wrong published pose
constexpr double kOtherPlace_m = 1.0;  // m, a peer published farther away cannot be this object
constexpr double kPlaceTime_s = 0.3;   // s, time constant of the place evidence
constexpr double kForgetMotion_s =
    20.0;  // s, motion evidence of a stationary object that fits no body decays: it had another cause
constexpr double kForgetShapeless_s = 5.0;  // s, same decay for an object that was never seen alone
constexpr int kMovedFrames = 3;             // in a merged blob: another object may change the outline
constexpr double kUnlistedStands_s =
    1.0;  // s of standing after which an unlisted robot loses its motion evidence
constexpr double kSurelyDrives_s = 2.0;  // s, motion without contact after which it keeps the evidence
constexpr double kBodyDrives_s = 1.0;    // s, the same for an object with the shape of a known body
constexpr double kShortestWindow_s = 0.25;
constexpr double kTrackedShare = 0.5;  // least ratio of the track's displacement to the outline's
constexpr double kFitsClearly =
    0.5;                             // log-odds of the shape; an object never seen whole may equally be a box
constexpr double kShapeViews = 8.0;  // views over which the shape evidence is averaged
constexpr double kMostRms_m = 0.04;  // m, residual of a pure shift between two views of one object
constexpr double kPlaceSigma_m = 0.04;  // m, σ of a track's centre in addition to its covariance

double seconds(TimeNs later, TimeNs earlier) {
  return static_cast<double>(later - earlier) * 1e-9;
}

double probability(double log_odds) {
  return 1.0 / (1.0 + std::exp(-log_odds));
}

struct Step {
  Displacement shift;      ///< in odom, or with the drift of odom removed; the shorter one
  double in_odom_m = 0.0;  ///< in odom alone
  double tracked_m = 0.0;  ///< displacement of the track in the direction of `shift`
};

/// Longest reliable displacement within the window. Invalid if the track is too young or not visible.
/// Odometry drifts and published poses jump: the shorter of both displacements counts.
Step displacementWithin(const TrackState& track, const OwnMotion& own, double window_s) {
  if (track.blob < 0) return {};
  for (const TrackState::Past& then : track.past) {
    const double age = seconds(track.view.time_ns, then.view.time_ns);
    if (age > window_s + 0.05) continue;
    if (age < kShortestWindow_s) break;
    const Displacement d = contactDisplacement(then.view, track.view);
    if (!d.valid || d.rms_m >= kMostRms_m) continue;
    const auto tracked = [&](const Displacement& shift, const Eigen::Vector2d& from_m) {
      return (track.filter.position() - from_m).dot(shift.moved_m.stableNormalized());
    };
    const Step by_odom{d, d.moved_m.norm(), tracked(d, then.centre_m)};
    const auto drift = own.driftSince(then.view.time_ns);
    if (!drift) return by_odom;
    const Displacement placed = contactDisplacement(then.view, track.view, *drift);
    if (!placed.valid || placed.moved_m.norm() >= by_odom.in_odom_m) return by_odom;
    return {placed, by_odom.in_odom_m, tracked(placed, *drift * then.centre_m)};
  }
  return {};
}

/// True if the object has moved. If the outline changes but the track stays, the blob is cut differently.
bool hasMoved(const Step& step, double least_m) {
  const double moved = step.shift.moved_m.norm();
  return step.shift.valid && step.tracked_m > kTrackedShare * moved &&
         moved > std::max(least_m, 4.0 * step.shift.sigma_m);
}

double shapeLogOdds(const BodyFit& fit, double fit_rms_m) {
  if (!fit.valid) return 0.0;
  const double ratio = fit.rms_m / fit_rms_m;
  return std::max(kMisfitEvidence, kFitEvidence * (1.0 - ratio * ratio));
}

/// True if the track's centre lies within the inner half of the peer's body with 2 σ.
bool isAtPeer(const TrackState& track, const Peer& peer) {
  const Eigen::Matrix2d c = peer.covariance + track.filter.positionCovariance();
  const double doubt_m = 2.0 * std::sqrt(0.5 * c.trace());
  return (track.filter.position() - peer.centre_m).norm() + doubt_m < 0.5 * peer.body.meanRadius();
}

bool accountedFor(const Peer& peer, bool matched, const OwnMotion& own, double sight_m) {
  if (!peer.known) return false;
  return matched || peer.in_blob || peer.may_be_there ||
         (peer.centre_m - own.odomFromBase().translation()).norm() > sight_m;
}

}  // namespace

KindOptions KindOptions::read(const options::Section& section) {
  KindOptions o;
  section.read("method", o.method, std::vector<std::string>{"log_odds", "vectors"});
  section.read("fit_rms_m", o.fit_rms_m, {0.001, 1.0});
  section.read("moved_m", o.moved_m, {0.01, 5.0});
  section.read("window_s", o.window_s, {0.2, 10.0});
  section.read("slow_window_s", o.slow_window_s, {0.2, 30.0});
  section.read("still_m", o.still_m, {0.001, 1.0});
  section.read("peer_gate_m", o.peer_gate_m, {0.01, 5.0});
  section.read("shape_range_m", o.shape_range_m, {0.1, 100.0});
  section.read("push_gap_m", o.push_gap_m, {0.0, 1.0});
  section.read("decide", o.decide, {0.5, 1.0});
  section.read("change", o.change, {0.5, 1.0});
  section.read("change_frames", o.change_frames, {1, 1000});
  section.finish();
  return o;
}

void KindJudge::judge(std::vector<TrackState>& tracks, const std::vector<Peer>& peers,
                      const LocalMap& local_map, const OwnMotion& own) {
  if (options_.method == "vectors") {
    for (TrackState& track : tracks) settleByVectors(track, local_map);
    return;
  }
  for (TrackState& track : tracks) {
    judgeMotion(track, tracks, own);
    judgeShape(track, peers, own);
  }
  judgePlaces(tracks, peers, own);
  for (TrackState& track : tracks) settle(track, peers, own.step_s());
}

bool KindJudge::touchesRobot(const TrackState& track, const std::vector<TrackState>& tracks,
                             const OwnMotion& own) const {
  // The depth behind the near side is the least certain part of the position.
  const double doubt_m = track.positionSigma() + track.filter.radiusSigma();
  const auto gap = [&](const Eigen::Vector2d& centre, double radius) {
    return (track.filter.position() - centre).norm() - radius - track.filter.radius() - doubt_m;
  };
  if (gap(own.odomFromBase().translation(), own_radius_m_) < options_.push_gap_m) return true;
  return std::any_of(tracks.begin(), tracks.end(), [&](const TrackState& other) {
    return other.id != track.id && other.kind == ObjectKind::kRobot &&
           gap(other.filter.position(), other.filter.radius()) < options_.push_gap_m;
  });
}

void KindJudge::judgeMotion(TrackState& track, const std::vector<TrackState>& tracks,
                            const OwnMotion& own) const {
  KindEvidence& e = track.evidence;
  e.touching_s = touchesRobot(track, tracks, own) ? 0.0 : e.touching_s + own.step_s();
  // An object never seen alone has no outline of its own: another object may cause the change.
  if (!track.whole) return;
  const Step lately = displacementWithin(track, own, options_.window_s);
  const Displacement& d = lately.shift;
  if (!d.valid) return;
  const double moved = d.moved_m.norm();
  track.moving = track.kind != ObjectKind::kObstacle || lately.in_odom_m > options_.still_m + 3.0 * d.sigma_m;
  const bool fits_none = e.shape < -0.5;
  // A slow motion: the same distance in a longer time, and still moving. Remains of shadows creep as well, as
  // light and view change; they fit no body.
  const auto crawls = [&] {
    if (!track.clean || fits_none) return false;
    const Step slow = displacementWithin(track, own, options_.slow_window_s);
    return hasMoved(slow, options_.moved_m) &&
           d.moved_m.dot(slow.shift.moved_m.stableNormalized()) > options_.still_m;
  };
  const bool drives = hasMoved(lately, options_.moved_m);
  if (drives || crawls()) {
    const bool alone = e.touching_s > 2.0 * options_.window_s;
    e.drives_s = alone ? e.drives_s + own.step_s() : 0.0;
    e.drove = e.drove || e.drives_s > (e.shape > kFitsClearly ? kBodyDrives_s : kSurelyDrives_s);
    if (++e.moved_frames < (drives && track.clean ? 1 : kMovedFrames)) return;
    e.pushed = e.shape < kFitsClearly && e.motion <= 0.0 && !alone;
    e.motion = e.pushed ? kPushedEvidence : kMovedEvidence;
    e.still_s = 0.0;
    return;
  }
  e.moved_frames = 0;
  e.drives_s = 0.0;
  if (moved > options_.still_m) return;
  e.still_s += own.step_s();
  const double forget_s = e.shape_views > 0 ? kForgetMotion_s : kForgetShapeless_s;
  if (e.motion > 0.0 && (fits_none || e.shape_views == 0)) e.motion *= std::exp(-own.step_s() / forget_s);
  if (e.motion <= 0.0 && e.still_s > options_.window_s) e.motion = kStillEvidence;
}

void KindJudge::judgeShape(TrackState& track, const std::vector<Peer>& peers, const OwnMotion& own) const {
  if (track.blob < 0) return;
  track.fit = BodyFit{};
  int best = -1;
  for (std::size_t i = 0; i < peers.size(); ++i) {
    const BodyFit fit = peers[i].body.fit(track.view);
    if (!fit.valid || (track.fit.valid && fit.rms_m >= track.fit.rms_m)) continue;
    track.fit = fit;
    best = static_cast<int>(i);
  }
  const double distance = (track.filter.position() - own.odomFromBase().translation()).norm();
  if (!track.clean || !track.fit.valid || distance > options_.shape_range_m) return;
  KindEvidence& e = track.evidence;
  const double weight = std::max(1.0 / kShapeViews, 1.0 / (1.0 + e.shape_views));
  e.shape += weight * (shapeLogOdds(track.fit, options_.fit_rms_m) - e.shape);
  e.best_body = best;
  ++e.shape_views;
}

void KindJudge::judgePlaces(std::vector<TrackState>& tracks, const std::vector<Peer>& peers,
                            const OwnMotion& own) const {
  Eigen::MatrixXd cost(static_cast<Eigen::Index>(peers.size()), static_cast<Eigen::Index>(tracks.size()));
  for (std::size_t i = 0; i < peers.size(); ++i) {
    for (std::size_t t = 0; t < tracks.size(); ++t) {
      const Eigen::Matrix2d c = peers[i].covariance + tracks[t].filter.positionCovariance();
      const double sigma = std::sqrt(0.5 * c.trace() + kPlaceSigma_m * kPlaceSigma_m);
      const double gate = std::clamp(3.0 * sigma, 0.5 * options_.peer_gate_m, 1.5 * options_.peer_gate_m);
      const double distance = (tracks[t].filter.position() - peers[i].centre_m).norm();
      cost(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(t)) =
          peers[i].known && tracks[t].isSeen() ? distance / gate : 1e3;
    }
  }
  const std::vector<int> track_of = assign(cost, 1.0);
  for (TrackState& track : tracks) track.evidence.peer = -1;
  std::vector<const Peer*> missing;  // robots that may be one of the unmatched objects
  for (std::size_t i = 0; i < peers.size(); ++i) {
    if (track_of[i] >= 0) tracks[static_cast<std::size_t>(track_of[i])].evidence.peer = static_cast<int>(i);
    if (!accountedFor(peers[i], track_of[i] >= 0, own, options_.shape_range_m)) missing.push_back(&peers[i]);
  }
  for (TrackState& track : tracks) {
    if (track.isSeen()) track.identity = track.evidence.peer;
  }
  weighPlaces(tracks, peers, missing, 1.0 - std::exp(-own.step_s() / kPlaceTime_s));
}

void KindJudge::weighPlaces(std::vector<TrackState>& tracks, const std::vector<Peer>& peers,
                            const std::vector<const Peer*>& missing, double rate) const {
  // Unmatched tracks, the likeliest robots first. At most as many of them can be robots as robots are
  // missing.
  std::vector<TrackState*> unclaimed;
  for (TrackState& track : tracks) {
    if (track.evidence.peer < 0) unclaimed.push_back(&track);
  }
  const auto likelihood = [](const TrackState* track) {
    return track->evidence.shape + track->evidence.motion;
  };
  std::stable_sort(unclaimed.begin(), unclaimed.end(),
                   [&](const TrackState* a, const TrackState* b) { return likelihood(a) > likelihood(b); });
  // A missing robot with a published place can only be an object near that place.
  const auto missingAt = [&](const TrackState& track) {
    return std::count_if(missing.begin(), missing.end(), [&](const Peer* peer) {
      return !peer->known || (peer->centre_m - track.filter.position()).norm() < kOtherPlace_m;
    });
  };
  const bool any_silent =
      std::any_of(missing.begin(), missing.end(), [](const Peer* peer) { return !peer->known; });
  const double may_be_one = any_silent ? 0.0 : kPeerMisplacedEvidence;
  const auto isHere = [&](const TrackState& track) {
    return isAtPeer(track, peers[static_cast<std::size_t>(track.evidence.peer)]) ? kPeerExactlyHereEvidence
                                                                                 : kPeerHereEvidence;
  };
  for (TrackState& track : tracks) {
    const auto place = std::find(unclaimed.begin(), unclaimed.end(), &track) - unclaimed.begin();
    double target = track.evidence.peer >= 0   ? isHere(track)
                    : place < missingAt(track) ? may_be_one
                                               : kPeersElsewhereEvidence;
    if (!track.isSeen()) continue;
    // Every robot of the fleet is accounted for and the object stands still: its earlier motion had another
    // cause, unless it drove far without contact.
    const bool no_peer = track.evidence.peer < 0 && missingAt(track) == 0;
    if (no_peer && !track.evidence.drove && track.evidence.still_s > kUnlistedStands_s)
      track.evidence.motion = std::min(0.0, track.evidence.motion);
    if (track.evidence.motion > 0.0)
      target = std::max(0.0, target);  // an unlisted robot: not in the fleet, but moving
    track.evidence.place += (track.views <= 1 ? 1.0 : rate) * (target - track.evidence.place);
  }
}

void KindJudge::settle(TrackState& track, const std::vector<Peer>& peers, double step_s) const {
  if (!track.isSeen()) return;
  const KindEvidence& e = track.evidence;
  const double p = probability(e.shape + e.place + e.motion);
  const ObjectKind leaning = p >= 0.5 ? ObjectKind::kRobot : ObjectKind::kObstacle;
  const double sure = std::max(p, 1.0 - p);
  const ObjectKind before = track.kind;
  // A new object with the shape of a robot where no robot of the fleet can be: its motion decides. A laser
  // sees only one side, which is not reliable enough to wait for.
  const bool unlisted = e.shape > kFitsClearly && e.place < 0.0 && e.motion == 0.0 &&
                        track.age_s < options_.window_s && track.view.camera_height_m > 0.0;
  if (track.kind == ObjectKind::kUnknown) {
    if (sure >= options_.decide && !unlisted) track.kind = leaning;
  } else if (leaning != track.kind && sure >= options_.decide) {
    // An object that is seen in one piece and moving changes at once. Less certain evidence must persist for
    // `window_s`.
    const bool drives = leaning == ObjectKind::kRobot && e.motion > 0.0 && track.clean;
    track.evidence.against += sure >= options_.change ? 1 : 0;
    track.evidence.against_s += step_s;
    if (track.evidence.against >= options_.change_frames || (drives && sure >= options_.change) ||
        track.evidence.against_s > options_.window_s)
      track.kind = leaning;
  } else {
    track.evidence.against = 0;
    track.evidence.against_s = 0.0;
  }
  track.kind_probability = track.kind == ObjectKind::kUnknown ? 0.0
                           : track.kind == leaning            ? sure
                                                              : 1.0 - sure;
  if (track.kind == before) return;
  track.evidence.against = 0;
  track.evidence.against_s = 0.0;
  track.moving = track.kind != ObjectKind::kObstacle;
  const int body = e.peer >= 0 ? e.peer : e.best_body;
  if (before == ObjectKind::kRobot) track.filter.forgetShape();
  if (track.kind != ObjectKind::kRobot || body < 0 || e.shape < 0.0) return;
  const BodyModel& model = peers[static_cast<std::size_t>(body)].body;
  track.filter.assumeBody(model.meanRadius(), model.height(), model.round());
  track.filter.update(track.view);
}

void KindJudge::settleByVectors(TrackState& track, const LocalMap& local_map) const {
  if (track.blob < 0) return;
  constexpr double kTolerance_m = 0.01;
  const ObjectObservation& object = local_map.objects[static_cast<std::size_t>(track.blob)];
  const VectorMotion vectors = vectorMotion(object, local_map.motion, local_map.scan.origin_m, kTolerance_m);
  const ObjectKind kind = kindByVectors(vectors, local_map.motion);
  if (kind == ObjectKind::kUnknown) return;
  track.kind = kind;
  track.kind_probability = 1.0;
}

}  // namespace omnifleet::tracking
