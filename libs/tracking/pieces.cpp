// The part of Tracker that handles robots of the fleet of which the camera separates only pieces from the
// floor, because the rest looks like the floor. Their published poses give their places.

#include <algorithm>
#include <cmath>

#include "tracking/outline_split.h"
#include "tracking/peer_outline.h"
#include "tracking/tracker.h"

namespace omnifleet::tracking {
namespace {

constexpr int kFewestDirections = 8;
constexpr double kOutline_m =
    0.05;  // m, tolerance between an outline and the one predicted at the published place
constexpr double kMostSigma_m =
    0.08;  // m, σ of the published place up to which pieces are matched; otherwise other objects would match
constexpr double kMostSigmaThere_m =
    0.15;  // m, σ of the published place up to which the scan is checked for the robot
constexpr double kExplained_m =
    0.04;  // m, an outline this close to the prediction of a track belongs to that track
constexpr double kStands_s =
    0.5;  // s, after which an obstacle counts as stationary; tops of robots seem to move

double sigmaOf(const Peer& peer) {
  return std::sqrt(0.5 * peer.covariance.trace());
}

}  // namespace

/// True if a stationary object that is no robot is expected to look like this from here.
bool Tracker::isOfAnObject(const View& view) const {
  return std::any_of(tracks_.begin(), tracks_.end(), [&](const TrackState& track) {
    return track.kind == ObjectKind::kObstacle && track.whole && track.evidence.still_s > kStands_s &&
           track.identity < 0 && outlineDistance(view, track.filter) < kExplained_m;
  });
}

void Tracker::lookForPeers(const LocalMap& local_map, std::vector<Peer>& peers) {
  peer_observations_.assign(peers.size(), PeerObservation{});
  if (!options_.pieces || local_map.camera_height_m <= 0.0) return;  // a laser detects every object in full
  for (std::size_t i = 0; i < peers.size(); ++i) {
    const double sigma_m = sigmaOf(peers[i]);
    if (!peers[i].known || sigma_m > kMostSigmaThere_m) continue;
    const PeerOutline expected(peers[i], eye_, kOutline_m + sigma_m);
    peers[i].may_be_there = expected.mayBeThere(local_map.scan);
    if (sigma_m > kMostSigma_m) continue;
    PeerObservation& seen = peer_observations_[i];
    std::vector<std::size_t> pieces;
    double nearest_m = INFINITY;
    for (std::size_t b = 0; b < views_.size(); ++b) {
      if (expected.isWhole(views_[b])) {
        seen.whole = true;  // handled like any other object
        continue;
      }
      if (piece_of_[b] >= 0 || !expected.encloses(views_[b]) || isOfAnObject(views_[b])) continue;
      if (pieces.empty()) seen.outline = views_[b];
      joinOutlines(views_[b], seen.outline);
      pieces.push_back(b);
      const double contact_m = (local_map.objects[b].contact_m - local_map.scan.origin_m).norm();
      if (contact_m >= nearest_m) continue;
      nearest_m = contact_m;
      seen.blob = static_cast<int>(b);
    }
    const bool in_pieces = !seen.whole && expected.sharedDirections(seen.outline) >= kFewestDirections;
    if (!in_pieces) seen.blob = -1;
    if (in_pieces) expected.keepOwn(seen.outline);
    if (in_pieces || seen.whole)
      for (const std::size_t b : pieces) piece_of_[b] = static_cast<int>(i);
    seen.undecided = !in_pieces && !seen.whole && expected.isUndecided(local_map.scan);
  }
}

/// @return index of the peer's track, preferring a visible one; −1: none
int Tracker::trackOf(std::size_t peer) const {
  int found = -1;
  for (std::size_t t = 0; t < tracks_.size(); ++t) {
    const TrackState& track = tracks_[t];
    if (track.identity != static_cast<int>(peer) || track.kind == ObjectKind::kObstacle) continue;
    if (found < 0 || track.blob >= 0) found = static_cast<int>(t);
  }
  return found;
}

int Tracker::startTrackOf(const Peer& peer, std::size_t number) {
  PrismFilter filter(options_.filter, peer.centre_m, eye_.camera_height_m);
  filter.assumeBody(peer.body.meanRadius(), peer.body.height(), peer.body.round());
  filter.placeAt(peer.centre_m, peer.velocity_mps, peer.covariance);
  const std::uint32_t id = known_peers_[number].id;
  tracks_.emplace_back(id == 0 || isFollowed(id) ? next_id_++ : id, filter);
  tracks_.back().identity = static_cast<int>(number);
  tracks_.back().whole = true;
  tracks_.back().moving = true;
  return static_cast<int>(tracks_.size()) - 1;
}

/// Updates peers that are visible only in pieces, or as an undecided object.
void Tracker::updatePieces(const LocalMap& local_map, const std::vector<Peer>& peers) {
  for (std::size_t i = 0; i < peers.size(); ++i) {
    const PeerObservation& seen = peer_observations_[i];
    if (!seen.whole && seen.blob < 0 && !seen.undecided) continue;
    int t = trackOf(i);
    const bool is_seen = t >= 0 && tracks_[static_cast<std::size_t>(t)].blob >= 0;
    if (t < 0 && !seen.whole) t = startTrackOf(peers[i], i);
    if (t < 0 || (seen.whole && !is_seen)) continue;
    for (std::size_t b = 0; b < piece_of_.size(); ++b)
      if (piece_of_[b] == static_cast<int>(i)) owners_[b].push_back(t);
    if (!is_seen) updateInPieces(tracks_[static_cast<std::size_t>(t)], peers[i], seen, local_map);
  }
}

void Tracker::updateInPieces(TrackState& track, const Peer& peer, const PeerObservation& seen,
                             const LocalMap& local_map) {
  track.blob = seen.blob;
  track.partly_seen = true;
  if (track.evidence.shape < 0.0) {  // the shape evidence was of pieces, too
    track.evidence.shape = 0.0;
    track.evidence.shape_views = 0;
  }
  if (seen.blob >= 0 && usableDirections(seen.outline) >= kFewestDirections && isOwn(track, seen.outline)) {
    updateTrack(track, seen.outline, local_map.objects[static_cast<std::size_t>(seen.blob)]);
    return;
  }
  track.filter.placeAt(peer.centre_m, peer.velocity_mps, peer.covariance);
  recordSighting(track, local_map.acquired_ns);
}

/// The blob contains the robot at its published place, but no direction of its own outline.
void Tracker::placeAsPublished(TrackState& track, TimeNs now_ns) {
  track.partly_seen = true;
  track.filter.placeAt(track.published->centre_m, track.published->velocity_mps, track.published->covariance);
  recordSighting(track, now_ns);
}

void Tracker::recordSighting(TrackState& track, TimeNs now_ns) {
  track.last_seen_m = track.filter.position();
  track.seen_ns = now_ns;
  track.unseen_s = 0.0;
  track.hidden = false;
  ++track.views;
}

}  // namespace omnifleet::tracking
