#include "estimation/jumps.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "estimation/agreement.h"
#include "estimation/starts.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSigma_m = 0.02, kMost = 9.0;  // of a thing's place; χ² at which it is another thing
constexpr double kMatch_m = 0.06;               // that is here
constexpr double kOneSide = 2.0;  // times as uncertain where one side of things is seen, as by a laser
constexpr double kWidth_m = 0.04, kWidthShare = 0.3;  // how much half widths may differ
constexpr double kLeastBase_m = 0.4;                  // between two things that tell a heading
constexpr double kSlip_m = 0.35, kSlip_rad = 0.35;    // from frame to frame
constexpr double kUnseen_m = 0.7, kUnseen_rad = 0.7;  // of one that has seen nothing for a while
constexpr int kNearMatches = 2, kFarMatches = 3;
constexpr double kNear = 12.0, kFar = 22.0;  // χ² by which a place must be better, by how rare it is …
constexpr double kRival = 4.0;               // … and than any other
constexpr int kLeastViews = 3;               // before a landmark is known well enough
constexpr double kOther_m = 0.25;            // so near a known thing a body is that thing
// Of places that a lost robot may be at:
constexpr double kClaimWay_m = 0.05;    // rolled from one look at them to the next
constexpr double kClaimForget = 0.8;    // what a look counts, to the next one
constexpr double kClaimWidth_m = 0.02;  // σ of half a width
constexpr int kClaimFrames = 5;         // looks at least …
constexpr double kClaimGain = 45.0;     // … and χ², as much as two things in three looks
constexpr double kClaimShare = 0.85;    // of all that is seen is explained there, …
constexpr double kClaimRival = 0.5;     // … and nowhere else so large a share of it

/// Something that stands where it is known to be, or that others see where the robot itself may be.
struct Known {
  Eigen::Vector2d place_m;  ///< map
  double height_m, half_width_m;
  bool itself = false;
};

/// What a robot sees, or itself.
struct Thing {
  std::optional<Footprint> footprint;  ///< none: itself
  Eigen::Vector2d in_base_m(double height_m) const {
    return footprint ? footprint->centre(height_m) : Eigen::Vector2d(0.0, 0.0);
  }
};

struct Match {
  Eigen::Vector2d in_base_m, in_map_m;
  double wider_m = 0.0;  ///< than what is known, half of it
};

struct Place {
  Pose2 map_from_base;
  std::vector<Match> matches;
  int missing = 0;
  double cost = 0.0;  ///< χ² of all things
  bool near = false;
};

class Search {
 public:
  Search(const FleetState& fleet, const RobotNode& robot, const std::vector<Seen>& seen, bool peers)
      : robot_(robot), here_(fleet.pose(robot.window.back().pose)) {
    for (const Seen& s : seen) {
      if (!s.mature) continue;
      things_.push_back({Footprint(*s.view)});
      if (!s.view->isCameras()) doubt_ = kOneSide;
    }
    for (const auto& [id, landmark] : fleet.landmarks) {
      if (landmark.views < kLeastViews || !isKnownTo(landmark)) continue;
      double width_m, by_height;
      landmark.shape->halfWidth(width_m, by_height);
      const double height_m = fleet.height(landmark);
      known_.push_back({fleet.centre(landmark), height_m, width_m - height_m * by_height});
    }
    for (const RobotNode& other : fleet.robots) {
      const auto at = fleet.poseAt(other, robot.window.back().time_ns);
      if (!peers || !at || !isCompany(other) || other.body->reach() <= 0) continue;
      known_.push_back({at->map_from_base.translation(), other.body->height(), other.body->reach()});
    }
    if (peers) addWitnesses(fleet);
  }

  Whereabouts result() const {
    Whereabouts result;
    const Place here = judge(here_);
    for (const Thing& thing : things_) result.things += thing.footprint ? 1 : 0;
    result.matches = static_cast<int>(here.matches.size());
    result.missing = here.missing;
    if (here.cost > kNear) result.elsewhere = best(places(), here);
    return result;
  }

  /// Every place where what is seen may be once more, and what speaks for it now.
  void weigh(std::vector<Claim>& claims) const {
    for (const Place& place : places()) {
      const bool known = std::any_of(claims.begin(), claims.end(), [&](const Claim& claim) {
        return areSame(claim.map_from_base, place.map_from_base);
      });
      if (!known) claims.push_back({place.map_from_base, 0.0, 0.0, 0});
    }
    for (Claim& claim : claims) weigh(claim);
  }

 private:
  void weigh(Claim& claim) const {
    const Place place = judge(claim.map_from_base);
    const double most = kMost * static_cast<double>(things_.size());
    double gain = most - place.cost;
    for (const Match& match : place.matches)
      gain -= std::min(kMost, match.wider_m * match.wider_m / (kClaimWidth_m * kClaimWidth_m));
    claim.gain = kClaimForget * claim.gain + gain;
    claim.most = kClaimForget * claim.most + most;
    if (place.matches.size() < kNearMatches) return;
    ++claim.frames;
    claim.map_from_base = rigid(place.matches);
  }

  /// A robot whose start nobody has confirmed is held against what it has seen itself.
  static bool isSure(const RobotNode& robot) {
    const Start& start = robot.start;
    return !start.given || isConfirmed(start) || (start.agreed > 0 && start.doubts <= 0);
  }

  bool isKnownTo(const Landmark& landmark) const {
    return isSure(robot_) || landmark.observers.count(robot_.setup.name) > 0;
  }

  bool isCompany(const RobotNode& other) const {
    return &other != &robot_ && other.located() && !other.doubt.displaced && other.doubt.unsure == 0 &&
           isSure(other) && isSure(robot_);
  }

  /// Others see a body like its own, that is nothing else they know: the robot itself.
  void addWitnesses(const FleetState& fleet) {
    const std::size_t others = known_.size();
    const TimeNs now_ns = robot_.window.back().time_ns;
    for (const RobotNode& other : fleet.robots) {
      if (!isCompany(other) || other.sight_aid.time_ns != now_ns) continue;
      const Pose2 map_from_other = fleet.pose(other.window.back().pose);
      for (const Eigen::Vector2d& p : bodies(fleet, other, *robot_.body)) {
        const Eigen::Vector2d place_m = map_from_other * p;
        const bool is_other =
            std::any_of(known_.begin(), known_.begin() + static_cast<std::ptrdiff_t>(others),
                        [&](const Known& k) { return (k.place_m - place_m).norm() < kOther_m; });
        if (!is_other) known_.push_back({place_m, 0.0, 0.0, true});
      }
    }
    if (known_.size() > others) things_.push_back({std::nullopt});
  }

  static bool isWhat(const Thing& thing, const Known& known) {
    if (!thing.footprint || known.itself) return !thing.footprint && known.itself;
    return std::abs(wider(thing, known)) < kWidth_m + kWidthShare * known.half_width_m;
  }

  static double wider(const Thing& thing, const Known& known) {
    if (!thing.footprint) return 0.0;
    return thing.footprint->half_width_m - known.height_m * thing.footprint->half_width_by_height -
           known.half_width_m;
  }

  Place judge(const Pose2& map_from_base) const {
    Place place;
    place.map_from_base = map_from_base;
    std::vector<bool> found(known_.size(), false);
    for (const Thing& thing : things_) {
      double nearest_m = doubt_ * kMatch_m;
      std::size_t what = known_.size();
      for (std::size_t k = 0; k < known_.size(); ++k) {
        if (found[k] || !isWhat(thing, known_[k])) continue;
        const double off_m = (map_from_base * thing.in_base_m(known_[k].height_m) - known_[k].place_m).norm();
        if (off_m < nearest_m) nearest_m = off_m, what = k;
      }
      const double sigma_m = doubt_ * kSigma_m;
      place.cost += std::min(kMost, nearest_m * nearest_m / (sigma_m * sigma_m));
      if (what == known_.size()) continue;
      found[what] = true;
      place.matches.push_back(
          {thing.in_base_m(known_[what].height_m), known_[what].place_m, wider(thing, known_[what])});
    }
    const Pose2 base_from_map = map_from_base.inverse();
    for (std::size_t k = 0; k < known_.size(); ++k) {
      if (found[k] || known_[k].itself || !isMissing(robot_, base_from_map * known_[k].place_m)) continue;
      ++place.missing;
      place.cost += kMost;
    }
    return place;
  }

  std::vector<Place> places() const {
    std::vector<Place> all;
    for (std::size_t i = 0; i < things_.size(); ++i) {
      for (std::size_t j = i + 1; j < things_.size(); ++j) addPairs(things_[i], things_[j], all);
    }
    return all;
  }

  void addPairs(const Thing& i, const Thing& j, std::vector<Place>& all) const {
    for (const Known& a : known_) {
      if (!isWhat(i, a)) continue;
      for (const Known& b : known_) {
        if (&a == &b || !isWhat(j, b)) continue;
        const std::vector<Match> pair{{i.in_base_m(a.height_m), a.place_m},
                                      {j.in_base_m(b.height_m), b.place_m}};
        const double seen_m = (pair[1].in_base_m - pair[0].in_base_m).norm();
        const double known_m = (b.place_m - a.place_m).norm();
        if (seen_m < kLeastBase_m || std::abs(seen_m - known_m) > doubt_ * kMatch_m) continue;
        // Through all that it explains, not only through the pair.
        const Place by_pair = judge(rigid(pair));
        if (by_pair.matches.size() < kNearMatches) continue;
        Place place = judge(rigid(by_pair.matches));
        place.near = isNear(place.map_from_base);
        all.push_back(std::move(place));
      }
    }
  }

  bool isNear(const Pose2& map_from_base) const {
    const Pose2 by = here_.inverse() * map_from_base;
    const bool unseen = robot_.doubt.unsure > 0;
    const Eigen::Vector3d sigma = robot_.covariance.diagonal().cwiseSqrt();
    const double reach_m = std::max(unseen ? kUnseen_m : kSlip_m, 3.0 * sigma.head<2>().maxCoeff());
    const double reach_rad = std::max(unseen ? kUnseen_rad : kSlip_rad, 3.0 * sigma.z());
    return by.translation().norm() < reach_m && std::abs(wrapAngle(by.theta_rad)) < reach_rad;
  }

  Pose2 rigid(const std::vector<Match>& matches) const {
    std::vector<Eigen::Vector2d> base, map;
    for (const Match& match : matches) base.push_back(match.in_base_m), map.push_back(match.in_map_m);
    return rigidMotion(base, map, here_.theta_rad);
  }

  static std::optional<Pose2> best(const std::vector<Place>& all, const Place& here) {
    for (const bool near : {true, false}) {
      const Place* best = nullptr;
      for (const Place& place : all) {
        const bool enough = static_cast<int>(place.matches.size()) >= (near ? kNearMatches : kFarMatches);
        if ((near && !place.near) || !enough) continue;
        if (best == nullptr || place.cost < best->cost) best = &place;
      }
      if (best == nullptr || best->cost + (near ? kNear : kFar) > here.cost) continue;
      const bool rivalled = std::any_of(all.begin(), all.end(), [&](const Place& place) {
        return (!near || place.near) && place.cost < best->cost + kRival &&
               !areSame(place.map_from_base, best->map_from_base);
      });
      if (!rivalled) return best->map_from_base;
    }
    return std::nullopt;
  }

  const RobotNode& robot_;
  Pose2 here_;
  double doubt_ = 1.0;
  std::vector<Thing> things_;
  std::vector<Known> known_;
};

}  // namespace

Whereabouts lookAround(const FleetState& fleet, const RobotNode& robot, const std::vector<Seen>& seen,
                       bool peers) {
  return Search(fleet, robot, seen, peers).result();
}

namespace {

/// What explains nothing any more, and what has become the same as one that explains more.
void dropClaims(std::vector<Claim>& claims) {
  std::stable_sort(claims.begin(), claims.end(),
                   [](const Claim& a, const Claim& b) { return a.gain > b.gain; });
  std::vector<Claim> kept;
  for (Claim& claim : claims) {
    const bool same = std::any_of(kept.begin(), kept.end(), [&](const Claim& other) {
      return areSame(claim.map_from_base, other.map_from_base);
    });
    if (!same && claim.gain > 0.0) kept.push_back(std::move(claim));
  }
  claims = std::move(kept);
}

}  // namespace

std::optional<Pose2> followClaims(const FleetState& fleet, RobotNode& robot, const std::vector<Seen>& seen) {
  const Step& step = robot.window.back();
  if (!step.isMeasured()) robot.doubt.claims.clear();
  for (Claim& claim : robot.doubt.claims)
    claim.map_from_base = claim.map_from_base * step.previous_from_current;
  robot.doubt.claimed_m += step.rolled_m;
  if (!robot.doubt.claims.empty() && robot.doubt.claimed_m < kClaimWay_m) return std::nullopt;
  robot.doubt.claimed_m = 0.0;
  Search(fleet, robot, seen, true).weigh(robot.doubt.claims);
  dropClaims(robot.doubt.claims);
  if (robot.doubt.claims.empty()) return std::nullopt;
  const Claim& best = robot.doubt.claims.front();
  const bool rivalled = robot.doubt.claims.size() > 1 && robot.doubt.claims[1].gain > kClaimRival * best.gain;
  if (rivalled || best.frames < kClaimFrames || best.gain < kClaimGain || best.gain < kClaimShare * best.most)
    return std::nullopt;
  return best.map_from_base;
}

void followUnseen(FleetState& fleet, RobotNode& robot, bool sees) {
  if (robot.window.size() < 2 || (sees && !robot.doubt.unseen)) return;
  const Step& step = robot.window.back();
  if (!robot.doubt.unseen) {
    robot.doubt.unseen.emplace();
    robot.doubt.unseen->map_from_base = fleet.pose(robot.window[robot.window.size() - 2].pose);
    robot.doubt.unseen->covariance = robot.covariance;
  }
  Unseen& unseen = *robot.doubt.unseen;
  const Pose2& by = step.previous_from_current;
  unseen.covariance = composeCovariance(unseen.covariance, by, step.own_covariance);
  unseen.way = unseen.way * by;
  unseen.rolled_m += by.translation().norm();
  unseen.turned_rad += std::abs(by.theta_rad);
}

bool wasCarried(const FleetState& fleet, const RobotNode& robot) {
  constexpr double kGate = 20.0;                         // χ² (3 dof, 2e-4)
  constexpr double kSlack_m = 0.01, kSlack_rad = 0.02;   // models are never exact, …
  constexpr double kWayShare = 0.01, kTurnShare = 0.02;  // … nor are wheels
  if (!robot.doubt.unseen) return false;
  const Unseen& unseen = *robot.doubt.unseen;
  const Pose2 predicted = unseen.map_from_base * unseen.way;
  const Eigen::Vector3d off = (predicted.inverse() * fleet.pose(robot.window.back().pose)).vector();
  const double way_m = kSlack_m + kWayShare * unseen.rolled_m;
  const double turn_rad = kSlack_rad + kTurnShare * unseen.turned_rad;
  const double side_m = way_m + 0.5 * turn_rad * unseen.way.translation().norm();
  Eigen::Matrix3d covariance = unseen.covariance + robot.covariance;
  covariance.diagonal() += Eigen::Vector3d(side_m * side_m, side_m * side_m, turn_rad * turn_rad);
  return off.dot(covariance.ldlt().solve(off)) > kGate;
}

void jumpTo(FleetState& fleet, RobotNode& robot, const Pose2& map_from_base) {
  constexpr double kSigma_m = 0.05, kSigma_rad = 0.05;  // of the new place; views sharpen it at once
  const Step& step = robot.window.back();
  Eigen::VectorXd& value = fleet.graph.value(step.pose);
  const Pose2 by = fleet.pose(step.pose).inverse() * map_from_base;
  const double turn = wrapAngle(by.theta_rad);
  value.head<2>() = map_from_base.translation();
  value(2) += turn;
  const double way_m = by.translation().norm() + kSigma_m, turn_rad = std::abs(turn) + kSigma_rad;
  fleet.loosen(robot, Eigen::Vector3d(way_m * way_m, way_m * way_m, turn_rad * turn_rad).asDiagonal());
  robot.covariance =
      Eigen::Vector3d(kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad).asDiagonal();
}

}  // namespace omnifleet::estimation
