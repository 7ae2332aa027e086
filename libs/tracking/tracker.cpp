#include "tracking/tracker.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>

#include "outline/half_planes.h"
#include "tracking/assignment.h"
#include "tracking/outline_split.h"

namespace omnifleet::tracking {
namespace {

constexpr int kFewestDirections = 8;
constexpr double kUnexplained_m =
    0.04;  // m, an outline that exceeds the expected one by more is another object's
constexpr double kPastSpacing_s =
    0.099;  // s, views closer in time add nothing to a displacement over a second
constexpr double kShortlyLost_s = 0.25;  // s, a robot unseen for longer is predicted from its published pose
constexpr double kPeerLeeway_m = 0.03;
constexpr double kPeerGate_m = 0.15;  // m, distance of outlines for a known body at a known place
constexpr double kLeap_m = 0.10;
constexpr double kMostSigma_m = 0.5;  // m, cap on σ of a place when searching for its blob
constexpr double kStartWindow_s = 0.5, kStartShift_m = 0.015, kOnePiece_m = 0.01;
constexpr double kLoosened_m = 0.05;
constexpr double kCut_m = 0.1;  // m, between pieces of one object
constexpr double kDisagreement =
    0.5;  // share of directions beyond 3 σ from which the shape estimate is wrong
constexpr double kUnlike_m =
    0.05;                  // m, a remaining distance of outlines from which the shape estimate is wrong
constexpr int kKnown = 3;  // views that make a track reliable

/// Covariance that one own step adds to a place at `arm_m` from the robot (odom axes).
Eigen::Matrix2d stepNoise(const OwnMotion& own, const Eigen::Vector2d& arm_m) {
  const Eigen::Matrix3d& c = own.stepCovariance();
  const Eigen::Matrix2d axes = own.odomFromBase().rotation();
  const Eigen::Vector2d across(-arm_m.y(), arm_m.x());
  return axes * c.topLeftCorner<2, 2>() * axes.transpose() + c(2, 2) * across * across.transpose();
}

Polygon silhouette(const TrackState& track, const View& view, const Pose2& base_from_odom) {
  std::vector<outline::HalfPlane> planes;
  const Eigen::Vector2d foot = base_from_odom * view.foot_m;
  for (std::size_t k = 0; k < view.size(); k += 4) {
    const double phi = view.angle(k) - view.heading_rad;
    const Eigen::Vector2d n(std::cos(phi), std::sin(phi));
    planes.push_back({n, track.filter.predictedSupport(view, k) + n.dot(foot)});
  }
  return outline::intersectHalfPlanes(planes, 100.0);
}

/// Distance of a point in odom outside of the footprint, metres.
double beyond(const PrismFilter& filter, const Eigen::Vector2d& point) {
  const Eigen::Vector2d away = point - filter.position();
  return away.norm() - filter.reach(std::atan2(away.y(), away.x()));
}

/// True if a stationary object starts to move: its contact side has shifted as one piece. A filter that holds
/// the object in place would treat the shift as outliers, and a robot that pushes it would soon overlap its
/// estimated place.
bool startsMoving(const TrackState& track) {
  for (auto then = track.past.rbegin(); then != track.past.rend(); ++then) {
    if (static_cast<double>(track.view.time_ns - then->view.time_ns) > 1e9 * kStartWindow_s) return false;
    const Displacement d = contactDisplacement(then->view, track.view);
    if (d.valid && d.rms_m < kOnePiece_m && d.moved_m.norm() > kStartShift_m + d.sigma_m) return true;
  }
  return false;
}

/// True if a stationary object is not at its estimated place. For an object whose far side alone is visible,
/// beside the own body mask, nothing else shows that it is pushed.
bool isOff(PrismFilter filter, const View& view) {
  return filter.update(view) > kDisagreement;
}

}  // namespace

TrackerOptions TrackerOptions::read(const options::Section& section) {
  TrackerOptions o;
  o.filter = PrismFilterOptions::read(section.child("filter"));
  section.read("gate_m", o.gate_m, {0.01, 5.0});
  section.read("merged_solidity", o.merged_solidity, {0.0, 1.0});
  section.read("cut_margin_m", o.cut_margin_m, {0.0, 1.0});
  section.read("keep_s", o.keep_s, {0.0, 600.0});
  section.read("keep_hidden_s", o.keep_hidden_s, {0.0, 600.0});
  section.read("keep_new_s", o.keep_new_s, {0.0, 600.0});
  section.read("max_contact_m", o.max_contact_m, {0.1, 100.0});
  section.read("gap_sigma_m", o.gap_sigma_m, {0.0, 10.0});
  section.read("locate_sigma_m", o.locate_sigma_m, {0.001, 10.0});
  section.read("lose_sigma_m", o.lose_sigma_m, {0.001, 10.0});
  if (o.lose_sigma_m < o.locate_sigma_m) section.fail("lose_sigma_m", "must not be below locate_sigma_m");
  section.read("composite_m", o.composite_m, {0.01, 10.0});
  section.read("history_s", o.history_s, {1.0, 30.0});
  section.finish();
  return o;
}

void Tracker::predict(const OwnMotion& own, bool continuous) {
  if (!continuous) deleted_tracks_.forget();
  for (TrackState& track : tracks_) {
    const Eigen::Vector2d arm = track.filter.position() - own.odomFromBase().translation();
    track.filter.predict(own.step_s(), track.moving, track.blob >= 0, stepNoise(own, arm));
    track.unseen_s += own.step_s();
    track.age_s += own.step_s();
    if (continuous) continue;
    track.filter.predictAcrossGap(options_.gap_sigma_m);
    track.past.clear();
    track.evidence.still_s = 0.0;
  }
  markUnseen();
}

void Tracker::markUnseen() {
  for (TrackState& track : tracks_) {
    track.blob = -1;
    track.partly_seen = false;
    track.clean = false;
    track.fit = BodyFit{};
    track.view.supports.b_m.clear();
    track.view.supports.sigma_m.clear();
  }
}

void Tracker::makeViews(const LocalMap& local_map, const OwnMotion& own) {
  views_.resize(local_map.objects.size());
  owners_.resize(local_map.objects.size());
  piece_of_.assign(local_map.objects.size(), -1);
  eye_.time_ns = local_map.acquired_ns;
  eye_.foot_m = own.odomFromBase() * local_map.scan.origin_m;
  eye_.heading_rad = own.odomFromBase().theta_rad;
  eye_.camera_height_m = local_map.camera_height_m;
  eye_.supports.b_m.resize(SupportFunction::kDirections);
  eye_.supports.sigma_m.resize(SupportFunction::kDirections);
  for (std::size_t i = 0; i < views_.size(); ++i) {
    views_[i].time_ns = eye_.time_ns;
    views_[i].supports = local_map.objects[i].supports;
    views_[i].foot_m = eye_.foot_m;
    views_[i].heading_rad = eye_.heading_rad;
    views_[i].camera_height_m = eye_.camera_height_m;
    owners_[i].clear();
  }
}

void Tracker::associate(const LocalMap& local_map, const OwnMotion& own, std::vector<Peer>& peers) {
  makeViews(local_map, own);
  followPeers(peers);
  lookForPeers(local_map, peers);
  cost_.resize(static_cast<Eigen::Index>(tracks_.size()), static_cast<Eigen::Index>(views_.size()));
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    const double sigma = std::min(kMostSigma_m, tracks_[t].positionSigma());
    const double gate = (tracks_[t].published ? kPeerGate_m : options_.gate_m) + 2.0 * sigma,
                 dearest = options_.gate_m + 3.0 * kMostSigma_m;
    for (std::size_t b = 0; b < views_.size(); ++b) {
      double& cost = cost_(static_cast<Eigen::Index>(t), static_cast<Eigen::Index>(b));
      cost = std::numeric_limits<double>::infinity();
      if (piece_of_[b] >= 0) continue;
      // A blob that touches the floor far in front of the object is another object, which may hide it.
      const Eigen::Vector2d contact = own.odomFromBase() * local_map.objects[b].contact_m;
      if (contact.allFinite() && beyond(tracks_[t].filter, contact) > options_.gate_m + 2.0 * sigma) continue;
      const double distance = outlineDistance(views_[b], tracks_[t].filter);
      // The cost is not the distance in σ: the least certain track would be the nearest to every blob.
      if (distance < gate) cost = (distance + sigma) / dearest;
    }
  }
  assignBlobs();
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    if (tracks_[t].blob < 0) joinEnclosingBlob(local_map, static_cast<int>(t));
  }
  joinPeers(peers);
}

/// Assigns tracks with a known place first: a track with an uncertain place must not take their blobs.
void Tracker::assignBlobs() {
  const auto isVague = [&](std::size_t t) { return tracks_[t].positionSigma() > options_.lose_sigma_m; };
  open_cost_.resize(cost_.rows(), cost_.cols());
  for (const bool vague : {false, true}) {
    open_cost_.setConstant(std::numeric_limits<double>::infinity());
    for (std::size_t t = 0; t < tracks_.size(); ++t) {
      if (isVague(t) == vague)
        open_cost_.row(static_cast<Eigen::Index>(t)) = cost_.row(static_cast<Eigen::Index>(t));
    }
    for (std::size_t b = 0; b < owners_.size(); ++b) {
      if (!owners_[b].empty())
        open_cost_.col(static_cast<Eigen::Index>(b)).setConstant(std::numeric_limits<double>::infinity());
    }
    const std::vector<int> blob_of = assign(open_cost_, 1.0);
    for (std::size_t t = 0; t < tracks_.size(); ++t) {
      if (blob_of[t] < 0) continue;
      tracks_[t].blob = blob_of[t];
      owners_[static_cast<std::size_t>(blob_of[t])].push_back(static_cast<int>(t));
    }
  }
}

void Tracker::update(const LocalMap& local_map, const OwnMotion& own, const std::vector<Peer>& peers) {
  for (std::size_t b = 0; b < views_.size(); ++b) {
    if (piece_of_[b] >= 0) continue;
    const ObjectObservation& object = local_map.objects[b];
    if (usableDirections(views_[b]) < kFewestDirections) {
      for (const int t : owners_[b]) tracks_[static_cast<std::size_t>(t)].blob = -1;
      continue;
    }
    const bool merged = owners_[b].size() > 1 || object.solidity < options_.merged_solidity;
    if (owners_[b].empty()) {
      start(object, b, views_[b], own, !merged);
    } else if (merged || showsMore(tracks_[static_cast<std::size_t>(owners_[b].front())], views_[b])) {
      updateMerged(object, b);
    } else {
      TrackState& track = tracks_[static_cast<std::size_t>(owners_[b].front())];
      track.clean = !object.truncated;
      updateAlone(track, views_[b], object, own);
    }
  }
  updatePieces(local_map, peers);
  end();
}

PrismFilter Tracker::fresh(const ObjectObservation& object, const View& view, const OwnMotion& own) const {
  const Eigen::Vector2d foot_in_base = own.odomFromBase().inverse() * view.foot_m;
  const Eigen::Vector2d outward = (object.contact_m - foot_in_base).stableNormalized();
  const Eigen::Vector2d guess = object.contact_m + options_.filter.radius_m * outward;
  return PrismFilter(options_.filter, own.odomFromBase() * guess, view.camera_height_m);
}

void Tracker::start(const ObjectObservation& object, std::size_t b, const View& view, const OwnMotion& own,
                    bool whole) {
  if (!object.contact_m.allFinite() || object.contact_m.norm() > options_.max_contact_m) return;
  PrismFilter filter = fresh(object, view, own);
  PrismFilter fitted = filter;
  fitted.update(view);
  if (object.truncated && isPieceOfKnown(fitted)) return;
  int t = lostAt(fitted, view);
  const bool found = t >= 0;
  if (!found) {
    t = static_cast<int>(tracks_.size());
    addTrack(fitted, view.time_ns);
    tracks_.back().filter = filter;
    tracks_.back().moving = true;
  }
  TrackState& track = tracks_[static_cast<std::size_t>(t)];
  if (found) reappear(track, fitted);
  track.blob = static_cast<int>(b);
  track.clean = whole && !object.truncated;
  owners_[b].push_back(t);
  if (found && whole) {
    updateAlone(track, view, object, own);
    return;
  }
  track.whole = track.whole || whole;
  updateTrack(track, view, object);
}

/// Adds a track. A peer with a published place there keeps its id. A recently deleted track there continues.
void Tracker::addTrack(const PrismFilter& filter, TimeNs now_ns) {
  if (const auto id = idOfPeerAt(filter.position())) {
    tracks_.emplace_back(*id, filter);
    return;
  }
  const auto before = deleted_tracks_.take(filter, options_.gate_m, now_ns, options_.keep_hidden_s);
  tracks_.emplace_back(before ? before->id : next_id_++, filter);
  if (!before) return;
  tracks_.back().evidence = before->evidence;
  tracks_.back().kind = before->kind;
  tracks_.back().kind_probability = before->kind_probability;
}

std::optional<std::uint32_t> Tracker::idOfPeerAt(const Eigen::Vector2d& place_m) const {
  for (const KnownPeer& peer : known_peers_) {
    if (!peer.known || peer.id == 0 || isFollowed(peer.id)) continue;
    if ((peer.centre_m - place_m).norm() < kPeerGate_m + 2.0 * peer.sigma_m) return peer.id;
  }
  return std::nullopt;
}

bool Tracker::isFollowed(std::uint32_t id) const {
  return std::any_of(tracks_.begin(), tracks_.end(), [&](const TrackState& track) { return track.id == id; });
}

/// True if the piece is cut off by the image edge, or by the own body mask, from a visible object that was
/// never seen whole.
bool Tracker::isPieceOfKnown(const PrismFilter& piece) const {
  return std::any_of(tracks_.begin(), tracks_.end(), [&](const TrackState& track) {
    if (track.blob < 0 || track.whole || track.dissolved) return false;
    const double apart_m = (piece.position() - track.filter.position()).norm();
    return apart_m < piece.radius() + track.filter.radius() + kCut_m;
  });
}

int Tracker::lostAt(const PrismFilter& filter, const View& view, bool rest_of_blob) const {
  int nearest = -1;
  double least = 1.0;
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    const TrackState& track = tracks_[t];
    if (track.blob >= 0 || !track.whole || track.dissolved) continue;
    // Three criteria: same place, matching outline from here, or a plausible distance travelled unseen.
    const double apart = (track.filter.position() - filter.position()).norm() / track.filter.radius();
    const double unlike = outlineDistance(view, track.filter) / options_.gate_m;
    const double way = track.published ? INFINITY
                                       : travelRatio(track.filter, track.last_seen_m, track.last_speed_mps,
                                                     track.unseen_s, filter);
    const double distance = std::min({apart, unlike, way});
    // A robot with a published place was just separated from this rest, unless the rest matches its outline
    // there.
    const bool unlike_it = unlike * options_.gate_m > kUnlike_m;
    if (rest_of_blob && unlike_it && track.published && track.published->contradicts(filter)) continue;
    if (distance >= least) continue;
    least = distance;
    nearest = static_cast<int>(t);
  }
  return nearest;
}

/// Moves a track that travelled unseen to the place where it reappears.
void Tracker::reappear(TrackState& track, const PrismFilter& seen) {
  if ((track.filter.position() - seen.position()).norm() <= track.filter.radius()) return;
  track.filter.placeAt(seen.position(), Eigen::Vector2d::Zero(), seen.positionCovariance());
  track.moving = true;
}

TrackState::Published Tracker::publishedBy(const Peer& peer) {
  const Eigen::Matrix2d leeway = kPeerLeeway_m * kPeerLeeway_m * Eigen::Matrix2d::Identity();
  return {peer.centre_m, peer.velocity_mps, peer.covariance + leeway, &peer.body};
}

void Tracker::followPeers(const std::vector<Peer>& peers) {
  known_peers_.resize(peers.size());
  for (std::size_t i = 0; i < peers.size(); ++i) {
    known_peers_[i].known = peers[i].known;
    known_peers_[i].centre_m = peers[i].centre_m;
    known_peers_[i].sigma_m = std::sqrt(0.5 * peers[i].covariance.trace());
  }
  for (TrackState& track : tracks_) {
    track.published.reset();
    if (track.identity < 0) continue;
    if (track.kind == ObjectKind::kRobot)
      known_peers_[static_cast<std::size_t>(track.identity)].id = track.id;
    const Peer& peer = peers[static_cast<std::size_t>(track.identity)];
    if (!peer.known) continue;
    track.published = publishedBy(peer);
    if (track.unseen_s >= kShortlyLost_s)
      track.filter.placeAt(peer.centre_m, peer.velocity_mps, track.published->covariance);
  }
}

void Tracker::updateAlone(TrackState& track, const View& view, const ObjectObservation& object,
                          const OwnMotion& own) {
  PrismFilter tried = track.filter;
  const double disagreement = tried.update(view);
  // The track was several objects, or part of one: it is visible alone for the first time.
  const bool other_shape =
      track.clean && (disagreement > kDisagreement || outlineDistance(view, tried) > kUnlike_m);
  if (other_shape && track.whole && track.evidence.motion > 0.0) {
    track.filter
        .forgetShape();  // it moves and has turned, or another object is here: its motion decides again
    track.evidence = KindEvidence{};
  } else if (other_shape || !track.whole) {
    track.restart(fresh(object, view, own));
  }
  track.whole = true;
  updateTrack(track, view, object);
  track.outline.add(track.view, track.filter);
}

void Tracker::updateTrack(TrackState& track, const View& view, const ObjectObservation& object) {
  track.view = view;
  if (!track.moving && (startsMoving(track) || (!track.whole && isOff(track.filter, view)))) {
    track.moving = true;
    track.filter.placeAt(
        track.filter.position(), Eigen::Vector2d::Zero(),
        track.filter.positionCovariance() + kLoosened_m * kLoosened_m * Eigen::Matrix2d::Identity());
  }
  const Eigen::Vector2d expected = track.filter.position();
  const double disagreement = track.filter.update(view);
  // A leap of the estimate is a change of the outline, not a motion: nothing is compared across it.
  if ((track.filter.position() - expected).norm() > kLeap_m) track.past.clear();
  if (track.clean) track.filter.updateHeight(object.height_m, object.height_sigma_m);
  const bool several =
      !track.whole && object.solidity < options_.merged_solidity &&
      track.filter.radius() > options_.composite_m;  // their centre is not the place of any of them
  // The far edge alone does not determine the place of an object behind others in a blob, however many views
  // there are.
  const bool behind = owners_[static_cast<std::size_t>(track.blob)].size() > 1;
  const bool determined = track.located || track.published || !behind || showsContact(view);
  track.located = disagreement < kDisagreement && !several && determined &&
                  track.positionSigma() <= (track.located ? options_.lose_sigma_m : options_.locate_sigma_m);
  track.last_seen_m = track.filter.position();
  if (track.clean || track.evidence.shape_views == 0) track.last_speed_mps = track.filter.velocity().norm();
  track.seen_ns = view.time_ns;
  track.unseen_s = 0.0;
  track.hidden = false;
  ++track.views;
  const auto age_s = [&](const View& v) { return static_cast<double>(view.time_ns - v.time_ns) * 1e-9; };
  while (!track.past.empty() && age_s(track.past.front().view) > options_.history_s) track.past.pop_front();
  if (track.past.empty() || age_s(track.past.back().view) > kPastSpacing_s)
    track.past.push_back({view, track.filter.position()});
}

void Tracker::end() {
  const auto lost = [&](const TrackState& track) {
    // An object seen in one piece, but only for a moment, exists at the limit of the detection range.
    const bool fleeting = track.views < kKnown && track.evidence.shape_views == 0;
    // A stationary object stays where it was.
    const bool stands = track.kind == ObjectKind::kObstacle && !track.moving;
    const double keep = fleeting || !track.whole ? options_.keep_new_s
                        : track.hidden || stands ? options_.keep_hidden_s
                                                 : options_.keep_s;
    return track.dissolved || track.unseen_s > keep;
  };
  // Indices in owners_ stay valid for the labels of the scan: only unseen tracks are removed, and they own no
  // blob.
  std::vector<int> moved(tracks_.size(), -1);
  int kept = 0;
  for (const TrackState& track : tracks_) {
    if (lost(track) && (track.whole || track.located) && track.views > 0) deleted_tracks_.add(track);
  }
  for (std::size_t t = 0; t < tracks_.size(); ++t) moved[t] = lost(tracks_[t]) ? -1 : kept++;
  tracks_.erase(std::remove_if(tracks_.begin(), tracks_.end(), lost), tracks_.end());
  for (std::vector<int>& owners : owners_) {
    for (int& t : owners) t = moved[static_cast<std::size_t>(t)];
    owners.erase(std::remove(owners.begin(), owners.end(), -1), owners.end());
  }
}

const TrackState* Tracker::trackAt(std::size_t blob, const Eigen::Vector2d& point_in_odom) const {
  const TrackState* nearest = nullptr;
  double least = std::numeric_limits<double>::infinity();
  for (const int t : owners_[blob]) {
    const TrackState& track = tracks_[static_cast<std::size_t>(t)];
    const double distance =
        std::abs((track.filter.position() - point_in_odom).norm() - track.filter.radius());
    if (distance >= least) continue;
    least = distance;
    nearest = &track;
  }
  return nearest;
}

void Tracker::write(const LocalMap& local_map, const OwnMotion& own, std::vector<Track>& out) const {
  out.resize(tracks_.size());
  const Pose2 base_from_odom = own.odomFromBase().inverse();
  const Eigen::Matrix2d axes = base_from_odom.rotation();
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    const TrackState& track = tracks_[i];
    Track& published = out[i];
    published.id = track.id;
    published.kind = track.kind;
    published.kind_probability = track.kind_probability;
    published.visible = isShown(track);
    published.position_m = base_from_odom * track.filter.position();
    published.velocity_mps = axes * track.filter.velocity();
    published.covariance = axes * track.filter.positionCovariance() * axes.transpose();
    published.height_m = track.filter.height();
    published.height_sigma_m = track.filter.heightSigma();
    published.supports = published.visible ? track.view.supports : SupportFunction{};
    published.points.clear();
    published.hull_m.clear();
    published.contact_m.setZero();
    published.solidity = 1.0;
    published.truncated = false;
    if (!published.visible) continue;
    if (track.partly_seen) {
      const Eigen::Vector2d to_eye = (eye_.foot_m - track.filter.position()).stableNormalized();
      const double reach_m = track.filter.reach(std::atan2(to_eye.y(), to_eye.x()));
      published.hull_m = silhouette(track, eye_, base_from_odom);
      published.contact_m = base_from_odom * (track.filter.position() + reach_m * to_eye);
      published.truncated = true;
      continue;
    }
    const auto blob = static_cast<std::size_t>(track.blob);
    const ObjectObservation& object = local_map.objects[blob];
    published.contact_m = object.contact_m;
    published.solidity = object.solidity;
    published.truncated = object.truncated;
    published.hull_m =
        owners_[blob].size() > 1 ? silhouette(track, views_[blob], base_from_odom) : object.hull_m;
  }
  writePoints(local_map, own, out);
}

}  // namespace omnifleet::tracking
