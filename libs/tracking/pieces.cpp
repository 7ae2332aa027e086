// The part of Tracker that deals with robots of the fleet of which the camera tells but pieces, as the rest
// of them looks like the floor: where they are is published.

#include <algorithm>
#include <cmath>

#include "tracking/outline_split.h"
#include "tracking/peer_sight.h"
#include "tracking/tracker.h"

namespace omnifleet::tracking {
namespace {

constexpr int kFewestDirections = 8;
constexpr double kOutline_m = 0.05;    // by which an outline may be off from the one of a known place …
constexpr double kMostSigma_m = 0.08;  // … and that place: else other things would be taken for pieces
constexpr double kMostSigmaThere_m = 0.15;  // of a place, of which a scan can tell whether somebody is there
constexpr double kExplained_m = 0.04;       // an outline so near to what a thing should show is the thing's
constexpr double kStands_s = 0.5;           // after which it is one that stands: tops of robots seem to move

double sigmaOf(const Peer& peer) {
  return std::sqrt(0.5 * peer.covariance.trace());
}

}  // namespace

/// Something that stands, and is no robot, is known to look just so from here.
bool Tracker::isOfAThing(const View& view) const {
  return std::any_of(tracks_.begin(), tracks_.end(), [&](const TrackState& track) {
    return track.kind == ObjectKind::kObstacle && track.whole && track.evidence.still_s > kStands_s &&
           track.identity < 0 && outlineDistance(view, track.filter) < kExplained_m;
  });
}

void Tracker::lookForPeers(const LocalMap& local_map, std::vector<Peer>& peers) {
  sights_.assign(peers.size(), PeerInSight{});
  if (!options_.pieces || local_map.camera_height_m <= 0.0) return;  // a laser tells all that it sees
  for (std::size_t i = 0; i < peers.size(); ++i) {
    const double sigma_m = sigmaOf(peers[i]);
    if (!peers[i].known || sigma_m > kMostSigmaThere_m) continue;
    const PeerSight sight(peers[i], eye_, kOutline_m + sigma_m);
    peers[i].may_be_there = sight.mayBeThere(local_map.scan);
    if (sigma_m > kMostSigma_m) continue;
    PeerInSight& seen = sights_[i];
    std::vector<std::size_t> pieces;
    double nearest_m = INFINITY;
    for (std::size_t b = 0; b < views_.size(); ++b) {
      if (sight.isWhole(views_[b])) {
        seen.whole = true;  // it goes the way of any other thing
        continue;
      }
      if (piece_of_[b] >= 0 || !sight.encloses(views_[b]) || isOfAThing(views_[b])) continue;
      if (pieces.empty()) seen.outline = views_[b];
      joinOutlines(views_[b], seen.outline);
      pieces.push_back(b);
      const double contact_m = (local_map.objects[b].contact_m - local_map.scan.origin_m).norm();
      if (contact_m >= nearest_m) continue;
      nearest_m = contact_m;
      seen.blob = static_cast<int>(b);
    }
    const bool in_pieces = !seen.whole && sight.sharedDirections(seen.outline) >= kFewestDirections;
    if (!in_pieces) seen.blob = -1;
    if (in_pieces) sight.keepOwn(seen.outline);
    if (in_pieces || seen.whole)
      for (const std::size_t b : pieces) piece_of_[b] = static_cast<int>(i);
    seen.undecided = !in_pieces && !seen.whole && sight.isUndecided(local_map.scan);
  }
}

/// @return index of the peer's track, the one that is seen if there is one; −1: none
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

/// What was seen of the peers but in pieces, or only that something is there.
void Tracker::seePieces(const LocalMap& local_map, const std::vector<Peer>& peers) {
  for (std::size_t i = 0; i < peers.size(); ++i) {
    const PeerInSight& seen = sights_[i];
    if (!seen.whole && seen.blob < 0 && !seen.undecided) continue;
    int t = trackOf(i);
    const bool is_seen = t >= 0 && tracks_[static_cast<std::size_t>(t)].blob >= 0;
    if (t < 0 && !seen.whole) t = startTrackOf(peers[i], i);
    if (t < 0 || (seen.whole && !is_seen)) continue;
    for (std::size_t b = 0; b < piece_of_.size(); ++b)
      if (piece_of_[b] == static_cast<int>(i)) owners_[b].push_back(t);
    if (!is_seen) glimpse(tracks_[static_cast<std::size_t>(t)], peers[i], seen, local_map);
  }
}

void Tracker::glimpse(TrackState& track, const Peer& peer, const PeerInSight& seen,
                      const LocalMap& local_map) {
  track.blob = seen.blob;
  track.glimpsed = true;
  if (track.evidence.shape < 0.0) {  // that was of pieces, too
    track.evidence.shape = 0.0;
    track.evidence.shape_views = 0;
  }
  if (seen.blob >= 0 && usableDirections(seen.outline) >= kFewestDirections && isOwn(track, seen.outline)) {
    see(track, seen.outline, local_map.objects[static_cast<std::size_t>(seen.blob)]);
    return;
  }
  track.filter.placeAt(peer.centre_m, peer.velocity_mps, peer.covariance);
  noteSight(track, local_map.acquired_ns);
}

/// A blob shows it, where it says that it is, and nothing of its own outline.
void Tracker::glimpseAsPublished(TrackState& track, TimeNs now_ns) {
  track.glimpsed = true;
  track.filter.placeAt(track.published->centre_m, track.published->velocity_mps, track.published->covariance);
  noteSight(track, now_ns);
}

void Tracker::noteSight(TrackState& track, TimeNs now_ns) {
  track.last_seen_m = track.filter.position();
  track.seen_ns = now_ns;
  track.unseen_s = 0.0;
  track.hidden = false;
  ++track.views;
}

}  // namespace omnifleet::tracking
