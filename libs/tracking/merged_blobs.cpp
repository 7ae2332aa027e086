// The part of Tracker that handles blobs in which several objects have merged.

#include <algorithm>
#include <cmath>
#include <limits>

#include "tracking/outline_split.h"
#include "tracking/tracker.h"

namespace omnifleet::tracking {
namespace {

constexpr int kFewestDirections = 8;
constexpr std::size_t kMaxPoints = 64;  // of one object, the limit of the topic
constexpr double kUnexplained_m =
    0.04;  // m, an outline that exceeds the expected one by more is another object's
constexpr double kExplained_m = 0.02;  // m, a blob that matches one outline this well is not merged
constexpr double kMostLeeway_m = 0.10;
constexpr double kPeerTracked_m =
    0.25;  // m, a track this close to the published place of a peer is that peer or blocks its place
constexpr double kPeerAside_m =
    0.08;  // m, a track farther from the peer's place may be the peer merged with another
constexpr double kPeerWidth_m = 0.02;  // m, the same if the radius differs by this
constexpr double kBehind_m = 0.4;  // m, σ of the place of a hidden object if only its far edge is visible
constexpr double kLikeRadius_m = 0.06;
constexpr double kOverlap_m = 0.05;
constexpr double kLeapSigmas = 3.0;
constexpr double kForeign = 0.5;  // share of directions beyond 3 σ from which the outline is another object's
constexpr double kGrown_m = 0.05;
constexpr double kFarEdge_m = 0.05;
constexpr int kMature = 3;  // views from which an outline is reliable
constexpr int kUnexplainedFrames =
    3;  // frames in a row before an unexplained part becomes an object of its own

/// True if the outline predicted for the peer at its published place lies within the blob's.
bool isEnclosed(const View& view, const Peer& peer, double margin_m) {
  int inside = 0, all = 0;
  const double ratio =
      view.camera_height_m > 0.0 ? std::max(0.03, 1.0 - peer.body.height() / view.camera_height_m) : 1.0;
  for (std::size_t k = 0; k < view.size(); ++k) {
    if (!view.usable(k)) continue;
    const double predicted = peer.body.predictedSupport(view, k, peer.centre_m, peer.heading_rad);
    ++all;
    inside += (predicted - view.supports.b_m[k]) * (predicted < 0.0 ? 1.0 : ratio) < margin_m ? 1 : 0;
  }
  return all >= kFewestDirections && inside >= 0.9 * all;
}

bool isPeer(const TrackState& track, const Peer& peer, double gate_m) {
  const double apart = (track.filter.position() - peer.centre_m).norm();
  return track.whole && apart < gate_m &&
         (track.kind == ObjectKind::kRobot ||
          std::abs(track.filter.radius() - peer.body.meanRadius()) < kLikeRadius_m);
}

/// True if an object touches the floor clearly in front of the peer's published place: the blob is not the
/// peer alone.
bool hasMoreBefore(const View& view, const Peer& peer, double sigma_m) {
  int before = 0;
  for (std::size_t k = 0; k < view.size(); ++k) {
    if (!view.usable(k)) continue;
    const double predicted = peer.body.predictedSupport(view, k, peer.centre_m, peer.heading_rad);
    const double margin_m = kUnexplained_m + 3.0 * view.supports.sigma_m[k] + 2.0 * sigma_m;
    before += predicted < 0.0 && view.supports.b_m[k] - predicted > margin_m ? 1 : 0;
  }
  return before >= 2 * kFewestDirections;
}

/// True if the track is neither at the peer's published place nor of the peer's width.
bool isMoreThan(const TrackState& track, const Peer& peer, double sigma_m) {
  const double wider_m = std::abs(track.filter.radius() - peer.body.meanRadius());
  if (track.kind == ObjectKind::kRobot && wider_m < kPeerWidth_m) return false;
  const double apart_m = (track.filter.position() - peer.centre_m).norm();
  return apart_m > kPeerAside_m + 2.0 * sigma_m || wider_m > kPeerWidth_m + 2.0 * track.filter.radiusSigma();
}

/// A laser separates objects by their ranges: an object behind another is hidden, never part of the blob in
/// front. Sides that become visible later are no other object.
bool isLaser(const View& view) {
  return view.camera_height_m <= 0.0;
}

/// The robot's own body at its published place.
PrismFilter bodyAsPublished(const TrackState& track) {
  PrismFilter filter = track.filter;
  const BodyModel& body = *track.published->body;
  if (std::abs(filter.radius() - body.meanRadius()) > kPeerWidth_m)
    filter.assumeBody(body.meanRadius(), body.height(), body.round());
  filter.placeAt(track.published->centre_m, track.filter.velocity(), track.published->covariance);
  return filter;
}

/// True if the blob contains more than the robot with a published place: its body there leaves much of the
/// outline unexplained.
bool isMoreThanItsBody(const TrackState& track, const View& view) {
  if (!track.published || track.kind == ObjectKind::kObstacle) return false;
  if (track.published->contradicts(track.filter)) return false;  // another object
  const double margin_m = std::max(kUnexplained_m, track.published->sigma());
  return unexplainedDirections(view, bodyAsPublished(track), margin_m) >= 2 * kFewestDirections;
}

/// True if part of the robot's contact side, at its published place, lies on the blob's outline: it is not
/// completely hidden.
bool isPartlyVisible(const TrackState& track, const View& view) {
  const PrismFilter body = bodyAsPublished(track);
  int shown = 0;
  for (std::size_t k = 0; k < view.size(); ++k) {
    if (!view.usable(k)) continue;
    const double predicted = body.predictedSupport(view, k);
    const double margin_m = kUnexplained_m + 3.0 * view.supports.sigma_m[k];
    shown += predicted < 0.0 && std::abs(view.supports.b_m[k] - predicted) < margin_m ? 1 : 0;
  }
  return shown >= kFewestDirections;
}

/// Two bodies cannot stand in one place.
bool overlap(const Eigen::Vector2d& a, double radius_a, const Eigen::Vector2d& b, double radius_b) {
  return (a - b).norm() < radius_a + radius_b - kOverlap_m;
}

bool overlap(const PrismFilter& a, const PrismFilter& b) {
  const Eigen::Vector2d across = b.position() - a.position();
  const double bearing = std::atan2(across.y(), across.x());
  return overlap(a.position(), a.reach(bearing), b.position(), b.reach(bearing + M_PI));
}

}  // namespace

void Tracker::joinEnclosingBlob(const LocalMap& local_map, int t) {
  TrackState& track = tracks_[static_cast<std::size_t>(t)];
  track.hidden = false;
  // An object that was visible only for a moment may have been a piece of this blob.
  if (!track.whole || (track.views < kMature && !track.published)) return;
  const double margin = options_.cut_margin_m + std::min(kMostLeeway_m, track.positionSigma());
  for (std::size_t b = 0; b < views_.size(); ++b) {
    if (!tracking::isEnclosed(views_[b], track.filter, margin)) continue;
    track.hidden = true;
    if (isLaser(views_[b]) || piece_of_[b] >= 0) return;
    const bool whole = local_map.objects[b].solidity >= options_.merged_solidity;
    const bool explained =
        whole && std::any_of(owners_[b].begin(), owners_[b].end(), [&](int owner) {
          const PrismFilter& filter = tracks_[static_cast<std::size_t>(owner)].filter;
          return outlineDistance(views_[b], filter) < kExplained_m &&
                 unexplainedDirections(views_[b], filter, kUnexplained_m) < kFewestDirections;
        });
    if (explained) return;
    track.blob = static_cast<int>(b);
    owners_[b].push_back(t);
    return;
  }
}

void Tracker::joinPeers(std::vector<Peer>& peers) {
  for (std::size_t i = 0; i < peers.size(); ++i) {
    Peer& peer = peers[i];
    peer.in_blob = peer_observations_[i].blob >= 0;  // visible in pieces
    if (!peer.known || peer.in_blob) continue;
    const double sigma = std::sqrt(0.5 * peer.covariance.trace());
    const bool tracked = std::any_of(tracks_.begin(), tracks_.end(), [&](const TrackState& track) {
      if (!isPeer(track, peer, kPeerTracked_m + 2.0 * sigma)) return false;
      if (track.blob < 0 || owners_[static_cast<std::size_t>(track.blob)].size() > 1) return true;
      return !isMoreThan(track, peer, sigma) ||
             !hasMoreBefore(views_[static_cast<std::size_t>(track.blob)], peer, sigma);
    });
    for (std::size_t b = 0; b < views_.size() && !peer.in_blob; ++b) {
      if (!isEnclosed(views_[b], peer, options_.cut_margin_m + std::min(kMostLeeway_m, sigma))) continue;
      peer.in_blob = true;
      if (!tracked && !isLaser(views_[b]) && piece_of_[b] < 0) startPeer(peer, i, b);
    }
  }
}

void Tracker::startPeer(const Peer& peer, std::size_t number, std::size_t b) {
  int vague = -1;
  for (const int t : owners_[b]) {
    TrackState& other = tracks_[static_cast<std::size_t>(t)];
    other.outline.forget();  // the remembered outline may have included the peer
    if (!overlap(other.filter.position(), other.filter.radius(), peer.centre_m, peer.body.meanRadius()))
      continue;
    // The track was the peer merged with another object. Its id stays with the peer if it was closer to the
    // peer's place.
    const bool stood_for_peer = (other.filter.position() - peer.centre_m).norm() < peer.body.meanRadius();
    if (!other.whole && stood_for_peer) vague = t;
    other.whole = false;
  }
  PrismFilter filter(options_.filter, peer.centre_m, views_[b].camera_height_m);
  filter.assumeBody(peer.body.meanRadius(), peer.body.height(), peer.body.round());
  filter.placeAt(peer.centre_m, peer.velocity_mps, peer.covariance);
  if (vague >= 0) {  // the other object, if any, gets a track of its own
    tracks_[static_cast<std::size_t>(vague)].restart(filter);
  } else {
    vague = static_cast<int>(tracks_.size());
    addTrack(filter, views_[b].time_ns);
    owners_[b].push_back(vague);
  }
  TrackState& track = tracks_[static_cast<std::size_t>(vague)];
  track.blob = static_cast<int>(b);
  track.identity = static_cast<int>(number);
  track.published = publishedBy(peer);
  track.whole = true;
  track.moving = true;
}

/// False if the part of a merged outline assigned to `track` may be the edge of another object. Such an edge
/// would pull a robot off its published place, or another object off its place or out of its shape.
bool Tracker::isOwn(const TrackState& track, const View& view) const {
  if (!track.published && track.views < kMature) return true;
  const PrismFilter& before = track.filter;
  PrismFilter tried = before;
  const double disagreement = tried.update(view);
  if (track.published && isMoreThanItsBody(track, views_[static_cast<std::size_t>(track.blob)]))
    return disagreement < kForeign && !track.published->contradicts(tried, 1.0);
  if (track.published) return !track.published->contradicts(tried);
  const double leap_m = (tried.position() - before.position()).norm();
  // A far edge alone may always belong to an object behind.
  const double most_m =
      std::min(kLeapSigmas * track.positionSigma(), showsContact(view) ? INFINITY : kFarEdge_m);
  const double grown_m = std::abs(tried.radius() - before.radius());
  return disagreement < kForeign && leap_m <= most_m &&
         grown_m <= kLeapSigmas * before.radiusSigma() + kGrown_m;
}

bool Tracker::showsMore(const TrackState& track, const View& view) const {
  if (!track.whole || (track.views < kMature && !track.published) || isLaser(view)) return false;
  if (isMoreThanItsBody(track, view)) return true;
  PrismFilter moved = track.filter;  // a motion since the last frame is not an unexplained part
  if (track.published) moved.updatePosition(track.published->centre_m, track.published->covariance);
  moved.update(view);
  if (track.published && track.published->contradicts(moved)) return true;
  return unexplainedDirections(view, moved, kUnexplained_m) >= 2 * kFewestDirections;
}

/// Collects the known objects in the blob. An object that was only seen as part of a blob counts as known if
/// the blob belonged to it alone before other objects joined: its outline is remembered.
void Tracker::findOwners(std::size_t b, int& vague) {
  split_owners_.clear();
  known_owners_.clear();
  vague = -1;
  const bool several = owners_[b].size() > 1;
  for (const int t : owners_[b]) {
    TrackState& track = tracks_[static_cast<std::size_t>(t)];
    const bool remembered = several && track.views >= kMature && track.outline.isGood(views_[b]);
    if (!track.whole && !remembered) {
      vague = t;
      continue;
    }
    // The remaining outline may belong to a neighbour. A robot stays at its published place.
    if (isMoreThanItsBody(track, views_[b])) {
      track.filter = bodyAsPublished(track);  // objects that merged with it have shifted the estimate
    } else if (track.published) {
      track.filter.updatePosition(track.published->centre_m, track.published->covariance);
    }
    known_owners_.push_back(t);
    split_owners_.push_back({&track.filter, remembered ? &track.outline : nullptr});
  }
}

void Tracker::updateMerged(const ObjectObservation& object, std::size_t b) {
  int vague = -1;
  findOwners(b, vague);
  if (known_owners_.empty()) {
    TrackState& track = tracks_[static_cast<std::size_t>(vague)];
    updateTrack(track, views_[b], object);
    track.outline.add(track.view, track.filter);
    return;
  }
  const int unexplained =
      splitOutline(views_[b], split_owners_, options_.cut_margin_m, kUnexplained_m, split_, rest_);
  for (std::size_t i = 0; i < known_owners_.size(); ++i) {
    TrackState& track = tracks_[static_cast<std::size_t>(known_owners_[i])];
    if (usableDirections(split_[i]) >= kFewestDirections && isOwn(track, split_[i])) {
      updateTrack(track, split_[i], object);
      continue;
    }
    track.blob = -1;
    if (isMoreThanItsBody(track, views_[b]) && isPartlyVisible(track, views_[b])) {
      placeAsPublished(track, views_[b].time_ns);
    } else {
      track.hidden = true;
    }
  }
  dissolveOverlaps(b);
  updateRest(object, b, vague, unexplained);
}

void Tracker::dissolveOverlaps(std::size_t b) {
  for (const int i : owners_[b]) {
    for (const int j : owners_[b]) {
      TrackState &one = tracks_[static_cast<std::size_t>(i)], &other = tracks_[static_cast<std::size_t>(j)];
      if (one.views <= other.views || one.dissolved || other.dissolved || !one.whole || !other.whole)
        continue;
      if (!overlap(one.filter, other.filter)) continue;
      other.dissolve();
    }
  }
}

void Tracker::updateRest(const ObjectObservation& object, std::size_t b, int vague, int unexplained) {
  TrackState& first = tracks_[static_cast<std::size_t>(known_owners_.front())];
  const bool enough = unexplained >= 2 * kFewestDirections;
  first.unexplained_frames = enough ? first.unexplained_frames + 1 : 0;
  if (vague >= 0) tracks_[static_cast<std::size_t>(vague)].dissolve();
  if (!enough && owners_[b].size() == 1 && first.blob >= 0) first.outline.add(first.view, first.filter);
  if (!enough || (vague < 0 && first.unexplained_frames < kUnexplainedFrames)) return;
  PrismFilter filter = freshRest();
  filter.update(rest_);
  const bool free = std::none_of(known_owners_.begin(), known_owners_.end(), [&](int t) {
    const TrackState& other = tracks_[static_cast<std::size_t>(t)];
    return other.whole && overlap(filter, other.filter);
  });
  if (!free) return;
  first.unexplained_frames = 0;
  const int lost = lostAt(filter, rest_, true);
  const int t = lost >= 0 ? lost : vague;
  if (t < 0) addTrack(filter, rest_.time_ns);
  TrackState& track = t < 0 ? tracks_.back() : tracks_[static_cast<std::size_t>(t)];
  if (t >= 0 && t == vague) {  // it stood for the whole blob so far
    track.restart(freshRest());
    track.dissolved = false;
  }
  if (lost >= 0) reappear(track, filter);
  track.whole = true;
  track.blob = static_cast<int>(b);
  if (t != vague) owners_[b].push_back(t < 0 ? static_cast<int>(tracks_.size()) - 1 : t);
  updateTrack(track, rest_, object);
}

PrismFilter Tracker::freshRest() const {
  std::size_t farthest = 0;
  double most = -std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < rest_.size(); ++k) {
    if (!rest_.usable(k) || rest_.supports.b_m[k] <= most) continue;
    most = rest_.supports.b_m[k];
    farthest = k;
  }
  const double phi = rest_.angle(farthest), ratio = 1.0 - options_.filter.height_ratio;
  const double distance = most < 0.0 ? most : std::max(0.0, most * ratio - options_.filter.radius_m);
  const Eigen::Vector2d guess = rest_.foot_m + distance * Eigen::Vector2d(std::cos(phi), std::sin(phi));
  PrismFilter filter(options_.filter, guess, rest_.camera_height_m);
  filter.placeAt(guess, Eigen::Vector2d::Zero(), kBehind_m * kBehind_m * Eigen::Matrix2d::Identity());
  return filter;
}

/// Assigns the surface points of each blob to the nearest object. Points of objects that are not published
/// are omitted.
void Tracker::writePoints(const LocalMap& local_map, const OwnMotion& own, std::vector<Track>& out) const {
  const std::size_t blobs = std::min(local_map.objects.size(), owners_.size());
  for (std::size_t blob = 0; blob < blobs; ++blob) {
    for (const FlowVector& vector : local_map.objects[blob].vectors) {
      if (!(vector.point.sigma_m > 0.0F)) continue;
      const Eigen::Vector2d place_m = vector.point.point_m.head<2>().cast<double>();
      const TrackState* owner = trackAt(blob, own.odomFromBase() * place_m);
      if (owner == nullptr || !isShown(*owner)) continue;
      auto& points = out[static_cast<std::size_t>(owner - tracks_.data())].points;
      if (points.size() < kMaxPoints) points.push_back(vector.point);
    }
  }
}

}  // namespace omnifleet::tracking
