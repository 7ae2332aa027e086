#include "estimation/association.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <set>
#include <tuple>

#include "estimation/agreement.h"
#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr double kMergedSolidity = 0.94;    // below this a silhouette is several objects
constexpr double kRaggedSolidity = 0.75;    // … or one with notches, …
constexpr double kRagged = 2.0;             // … of which the σ are so much larger
constexpr double kFacing_rad = 1.2;         // half of the side of a thing that is turned to the camera
constexpr double kLost_rad = 0.05;          // σ of a heading
constexpr int kLeastDirections = 12;        // usable ones that still hold a position
constexpr double kRough_m = 0.05;           // σ of an outline that is inferred more than it is seen
constexpr double kFarthestContact_m = 1.9;  // beyond it a camera's own errors outweigh what a view tells

/// A pair that may belong together; sorted by distance, then by order of appearance.
struct Candidate {
  double distance_m;
  std::size_t seen, other;
  bool operator<(const Candidate& o) const {
    return std::tie(distance_m, seen, other) < std::tie(o.distance_m, o.seen, o.other);
  }
};

bool isRough(const View& view) {
  double sum = 0.0;
  for (const double sigma : view.sigma_m) sum += sigma;
  return sum > kRough_m * view.sigma_factor * std::max(1, view.usable());
}

double uncertainty(const RobotNode& robot) {
  return std::sqrt(std::max(0.0, robot.covariance.topLeftCorner<2, 2>().trace()));
}

/// Another robot as one sees it, and how that may see it back.
struct Sighting {
  const RobotNode& observer;
  const RobotNode& peer;
  std::size_t peer_index;
  Pose2 map_from_base, map_from_peer;  ///< as said
  Eigen::Vector2d seen_m;              ///< in base_link
  TimeNs time_ns;

  Eigen::Vector2d place_m() const { return map_from_base * seen_m; }
};

/// The other sees a body like the observer's as far away, and not what the observer sees: a thing between.
bool isMutual(const FleetState& fleet, const Sighting& sighting) {
  constexpr double kSame_m = 0.05, kApart = 0.5;
  constexpr TimeNs kLately_ns = 300000000;
  if (sighting.time_ns - sighting.peer.sight_aid.time_ns > kLately_ns) return false;
  const double away_m = sighting.seen_m.norm();
  const auto seen = bodies(fleet, sighting.peer, *sighting.observer.body);
  return std::any_of(seen.begin(), seen.end(), [&](const Eigen::Vector2d& p) {
    return std::abs(p.norm() - away_m) < kSame_m &&
           (sighting.map_from_peer * p - sighting.place_m()).norm() > kApart * away_m;
  });
}

/// What looks like a robot far beside where that is said to be is it if it goes as that goes, or if that sees
/// the observer, too.
bool isPeer(const FleetState& fleet, RobotNode& observer, std::uint32_t track, const Sighting& sighting,
            double beside_m) {
  constexpr double kWay_m = 0.25, kShare = 0.3;
  const auto before = observer.track_aid.known.find(track);
  if (before != observer.track_aid.known.end() && before->second.landmark == 0)
    return before->second.robot == sighting.peer_index;
  const auto key = std::pair(track, sighting.peer_index);
  const Eigen::Vector2d place_m = sighting.place_m(), said_m = sighting.map_from_peer.translation();
  auto suspect = observer.track_aid.suspects.find(key);
  if (suspect == observer.track_aid.suspects.end()) {
    if (beside_m < fleet.options.sighting_gate_m) return true;
    suspect = observer.track_aid.suspects.insert({key, {place_m, said_m}}).first;
  }
  const Eigen::Vector2d way_m = said_m - suspect->second.said_m;
  const bool goes =
      way_m.norm() > kWay_m && (place_m - suspect->second.place_m - way_m).norm() < kShare * way_m.norm();
  return goes || isMutual(fleet, sighting);
}

bool isWhole(const Seen& seen) {
  return !seen.track->truncated && !isRough(*seen.view) && Footprint(*seen.view).whole;
}

/// All of the side towards the camera is seen.
bool facesCamera(const Seen& seen) {
  const View& view = *seen.view;
  const int k = static_cast<int>(view.sigma_m.size());
  const Eigen::Vector2d back = view.foot_m - seen.track->position_m;
  const double towards = std::atan2(back.y(), back.x());
  for (int i = 0; i < k; ++i) {
    const double off = wrapAngle(2.0 * M_PI * i / k - towards);
    if (std::abs(off) < kFacing_rad && view.sigma_m[static_cast<std::size_t>(i)] <= 0) return false;
  }
  return true;
}

/// What the edge of the view cuts off stands where its sides that are seen say.
bool isPart(const Seen& seen) {
  if (!facesCamera(seen)) return false;
  return seen.track->truncated && seen.track->solidity >= kMergedSolidity && !isRough(*seen.view) &&
         Footprint(*seen.view).partly;
}

/// The wheels alone do not tell its heading any more.
bool needsAny(const RobotNode& robot, const std::vector<Seen>& seen) {
  return robot.located() && robot.covariance(2, 2) > kLost_rad * kLost_rad &&
         std::none_of(seen.begin(), seen.end(), [](const Seen& s) { return s.mature; });
}

/// What has holes and notches where it looks like the floor may be one thing none the less, and its hull that
/// thing's. It is believed less; and where it is several things its views do not agree.
void takeRagged(std::vector<Seen>& seen) {
  for (Seen& s : seen) {
    if (s.track->solidity < kRaggedSolidity || !isWhole(s)) continue;
    for (double& sigma : s.view->sigma_m) sigma *= kRagged;
    s.informative = true;
  }
}

}  // namespace

std::vector<Seen> silhouettes(const FleetState& fleet, const Objects& frame) {
  std::vector<Seen> all;
  const RobotNode* robot = fleet.find(frame.robot);
  const CameraError error = robot == nullptr ? CameraError::Zero() : fleet.cameraError(*robot);
  const lens::Spread lens = robot == nullptr ? lens::Spread() : robot->setup.lens;
  if (frame.state != FrameState::kOk || !(frame.camera_height_m >= 0)) return all;
  for (const Track& track : frame.tracks) {
    if (!track.visible || track.supports.empty() || !track.position_m.allFinite()) continue;
    const bool is_far = (track.contact_m - frame.scan.origin_m).norm() > kFarthestContact_m;
    if (is_far && frame.camera_height_m > 0) continue;
    Seen seen;
    seen.track = &track;
    seen.view = std::make_shared<View>(
        View::from(track, frame.scan.origin_m, frame.camera_height_m, fleet.options.view_sigma_factor, lens));
    seen.view->assume(error);
    if (seen.view->usable() < kLeastDirections) continue;
    seen.mature = track.solidity >= kMergedSolidity && isWhole(seen);
    seen.informative = seen.mature || isPart(seen);
    all.push_back(std::move(seen));
  }
  if (robot != nullptr && needsAny(*robot, all)) takeRagged(all);
  return all;
}

void matchPeers(FleetState& fleet, RobotNode& observer, const Objects& frame, std::vector<Seen>& seen) {
  const Pose2 map_from_base = fleet.pose(observer.window.back().pose);
  const Pose2 base_from_map = map_from_base.inverse();
  std::vector<Candidate> candidates;
  std::vector<PoseAt> at(fleet.robots.size());
  for (std::size_t r = 0; r < fleet.robots.size(); ++r) {
    RobotNode& peer = fleet.robots[r];
    const auto known = fleet.poseAt(peer, frame.acquired_ns);
    if (&peer == &observer || !known || peer.doubt.displaced || peer.body->reach() <= 0) continue;
    at[r] = *known;
    const Pose2 base_from_peer = base_from_map * known->map_from_base;
    const double gate =
        fleet.options.sighting_gate_m + std::min(0.5, 3.0 * (uncertainty(peer) + uncertainty(observer)));
    for (std::size_t s = 0; s < seen.size(); ++s) {
      if ((seen[s].track->position_m - base_from_peer.translation()).norm() > gate + 0.5) continue;
      const BodyFit fit =
          fitBody(*seen[s].view, *peer.body, base_from_peer.theta_rad, base_from_peer.translation());
      const double distance = (fit.position_m - base_from_peer.translation()).norm();
      if (fit.rms_m >= fleet.options.sighting_rms_m || distance >= gate) continue;
      const Sighting sighting{observer,         peer, r, map_from_base, known->map_from_base, fit.position_m,
                              frame.acquired_ns};
      if (isPeer(fleet, observer, seen[s].track->id, sighting, distance))
        candidates.push_back({distance, s, r});
    }
  }
  std::sort(candidates.begin(), candidates.end());
  std::vector<bool> taken(fleet.robots.size(), false);
  for (const Candidate& c : candidates) {
    if (taken[c.other] || seen[c.seen].peer != nullptr) continue;
    taken[c.other] = true;
    seen[c.seen].peer = &fleet.robots[c.other];
    seen[c.seen].peer_at = at[c.other];
    observer.track_aid.known[seen[c.seen].track->id] = {0, c.other};
  }
}

namespace {

/// A whole thing where none is known: neither a splinter of one nor one that is only seen amiss.
bool isStrange(const FleetState& fleet, const RobotNode& robot, const Seen& seen) {
  constexpr double kSplinter_m = 0.03;  // half of its mean width
  constexpr double kSamePlace_m = 0.05;
  if (!seen.mature || seen.peer != nullptr || seen.landmark != 0) return false;
  const Footprint footprint(*seen.view);
  const double height_m = std::max(0.0, seen.track->height_m);
  if (footprint.half_width_m - height_m * footprint.half_width_by_height < kSplinter_m) return false;
  const Pose2 map_from_base = fleet.pose(robot.window.back().pose);
  return std::none_of(fleet.landmarks.begin(), fleet.landmarks.end(), [&](const auto& entry) {
    const Eigen::Vector2d at = map_from_base * footprint.centre(fleet.height(entry.second));
    return (fleet.centre(entry.second) - at).norm() < kSamePlace_m;
  });
}

}  // namespace

bool isDisplaced(const FleetState& fleet, const RobotNode& robot, const std::vector<Seen>& seen) {
  constexpr TimeNs kRecent_ns = 3000000000;
  constexpr double kNear_m = 1.3;
  int strange = 0, familiar = 0;
  std::set<std::uint32_t> found;
  for (const Seen& s : seen) {
    const bool known =
        s.peer != nullptr ||
        (s.landmark != 0 && fleet.landmarks.at(s.landmark).observers.count(robot.setup.name) > 0);
    familiar += known ? 1 : 0;
    strange += isStrange(fleet, robot, s) ? 1 : 0;
    if (s.landmark != 0) found.insert(s.landmark);
  }
  const Eigen::Vector2d here = fleet.pose(robot.window.back().pose).translation();
  const auto missing = std::count_if(fleet.landmarks.begin(), fleet.landmarks.end(), [&](const auto& entry) {
    const auto mine = entry.second.observers.find(robot.setup.name);
    return mine != entry.second.observers.end() &&
           robot.doubt.seeing_ns - mine->second.seen_ns < kRecent_ns && found.count(entry.first) == 0 &&
           (fleet.centre(entry.second) - here).norm() < kNear_m;
  });
  return strange >= 2 && missing >= 2 && strange >= 2 * familiar;
}

void addViews(FleetState& fleet, RobotNode& observer, const std::vector<Seen>& seen) {
  const VariableId pose = observer.window.back().pose;
  const int directions = fleet.options.view_directions;
  for (const Seen& s : seen) {
    ViewLink link;
    link.observer = pose;
    link.view = s.view;
    link.track = s.track->id;
    // Two robots that their scans hold to the same keyframes need no sighting: what looks like a robot may be
    // a piece of furniture.
    if (s.peer != nullptr && observer.scan_aid.suffices && s.peer->scan_aid.suffices) continue;
    if (s.peer != nullptr) {
      link.object = s.peer_at.pose;
      link.size = fleet.size(*s.peer);
      auto cost = std::make_unique<PeerViewFactor>(s.view, s.peer->body, s.peer_at.offset, directions);
      fleet.addViewFactor(observer, std::move(link), std::move(cost));
    } else if (s.landmark != 0) {
      Landmark& landmark = fleet.landmarks.at(s.landmark);
      link.object = landmark.variable;
      link.size = landmark.size;
      link.landmark = landmark.id;
      auto cost = std::make_unique<LandmarkViewFactor>(s.view, landmark.shape, directions);
      fleet.addViewFactor(observer, std::move(link), std::move(cost));
      landmark.last_seen_ns = observer.window.back().time_ns;
      Observer& mine = landmark.observers[observer.setup.name];
      mine.seen_ns = landmark.last_seen_ns;
      if (!observer.window.back().keyframe) continue;
      ++landmark.views;
      ++mine.views;
    }
  }
}

void noteFits(FleetState& fleet, const RobotNode& robot) {
  struct Squares {
    double sum_m2 = 0.0;
    int views = 0;
  };
  std::map<std::uint32_t, Squares> of;
  for (const Step& step : robot.window) {
    for (const ViewLink& link : step.views) {
      if (link.landmark == 0 || !fleet.graph.hasFactor(link.factor)) continue;
      of[link.landmark].sum_m2 += link.rms_m * link.rms_m;
      ++of[link.landmark].views;
    }
  }
  for (const auto& [id, squares] : of)
    fleet.landmarks.at(id).observers[robot.setup.name].rms_m = std::sqrt(squares.sum_m2 / squares.views);
}

}  // namespace omnifleet::estimation
