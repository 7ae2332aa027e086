#include "estimation/starts.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdio>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr double kMatch_m = 0.10;      // between a thing seen and what it should be
constexpr double kEmpty_m = 0.30;      // nothing is seen so near the place of something: it is missing there
constexpr double kTooNear_m = 0.35;    // of the camera: hidden by the own body
constexpr double kPlainSight_m = 1.2;  // of the camera: not missed there
constexpr double kBodyShare = 0.5;     // of sighting_rms_m
constexpr double kWidth_m = 0.04, kWidthShare = 0.3;  // how much half widths may differ
constexpr double kSameDistance_m = 0.05, kLeastBase_m = 0.4;
constexpr double kSame_m = 0.12, kSame_rad = 0.12;  // hypotheses nearer than this are the same
constexpr std::size_t kMostElsewhere = 30;
constexpr int kFrames = 3;                          // of doubt, before a robot is moved
constexpr double kRefuted = 2.5, kUnseen = 3.5;     // score per frame of the other place, by kind of doubt …
constexpr double kLead = 3.0, kRivalLead = 1.0;     // … and before that of the start, of any other
constexpr int kConfirmed = 5;                       // frames that agree: asked no more
constexpr double kSigma_m = 0.05, kSigma_rad = 0.05;  // of the placed pose; views sharpen it at once

/// Something that the others know of.
struct Anchor {
  Eigen::Vector2d place_m;
  double height_m;
  double half_width_m;
  const RobotNode* robot;  ///< nullptr: an obstacle
  double theta_rad;
};

struct Agreement {
  int matches = 0, misses = 0;
  int score() const { return matches - misses; }
};

struct Hypothesis {
  Pose2 map_from_base;
  Agreement agreement;
};

std::vector<Anchor> anchorsFor(const FleetState& fleet, const RobotNode& robot, TimeNs time_ns) {
  std::vector<Anchor> all;
  for (const auto& [id, landmark] : fleet.landmarks) {
    const bool of_others = std::any_of(landmark.seen_ns.begin(), landmark.seen_ns.end(),
                                       [&](const auto& entry) { return entry.first != robot.setup.name; });
    if (!of_others) continue;
    double width_m, width_by_height;
    landmark.shape->halfWidth(width_m, width_by_height);
    const double height_m = fleet.height(landmark);
    all.push_back({fleet.centre(landmark), height_m, width_m - height_m * width_by_height, nullptr, 0.0});
  }
  for (const RobotNode& other : fleet.robots) {
    const auto at = fleet.poseAt(other, time_ns);
    if (&other == &robot || !at || other.displaced || other.body->reach() <= 0) continue;
    all.push_back({at->map_from_base.translation(), other.body->height(), other.body->reach(), &other,
                   at->map_from_base.theta_rad});
  }
  return all;
}

bool isBody(const FleetState& fleet, const Seen& seen, const RobotNode& robot, const Pose2& base_from_robot) {
  if ((seen.track->position_m - base_from_robot.translation()).norm() > 0.5) return false;
  const BodyFit fit =
      fitBody(*seen.view, *robot.body, base_from_robot.theta_rad, base_from_robot.translation());
  return fit.rms_m < kBodyShare * fleet.options.sighting_rms_m &&
         (fit.position_m - base_from_robot.translation()).norm() < kMatch_m;
}

bool isEmptyAround(const std::vector<Seen>& seen, const Eigen::Vector2d& in_base_m) {
  return std::none_of(seen.begin(), seen.end(), [&](const Seen& s) {
    return (s.track->position_m - in_base_m).norm() < kEmpty_m;
  });
}

bool inPlainSight(const Eigen::Vector2d& in_base_m) {
  const double away_m = in_base_m.norm();
  return away_m > kTooNear_m && away_m < kPlainSight_m;
}

bool isWhat(const FleetState& fleet, const Seen& seen, const Footprint& footprint, const Pose2& map_from_base,
            const Anchor& anchor) {
  if (anchor.robot == nullptr) {
    const double width_m = footprint.half_width_m - anchor.height_m * footprint.half_width_by_height;
    return std::abs(width_m - anchor.half_width_m) < kWidth_m + kWidthShare * anchor.half_width_m &&
           (map_from_base * footprint.centre(anchor.height_m) - anchor.place_m).norm() < kMatch_m;
  }
  const Pose2 map_from_robot{anchor.place_m.x(), anchor.place_m.y(), anchor.theta_rad};
  return isBody(fleet, seen, *anchor.robot, map_from_base.inverse() * map_from_robot);
}

/// Of a robot at a place with what the others see and know.
Agreement agreementAt(const FleetState& fleet, const Sight& own, const Pose2& map_from_base,
                      const std::vector<Anchor>& anchors, const std::vector<Sight>& sights) {
  Agreement result;
  const Pose2 base_from_map = map_from_base.inverse();
  std::vector<bool> found(anchors.size(), false);
  for (const Seen& seen : *own.seen) {
    if (!seen.mature) continue;
    const Footprint footprint(*seen.view);
    bool known = false;
    for (std::size_t i = 0; i < anchors.size() && !known; ++i) {
      known = !found[i] && isWhat(fleet, seen, footprint, map_from_base, anchors[i]);
      if (known) found[i] = true;
    }
    result.matches += known ? 1 : 0;
    if (known || !inPlainSight(seen.track->position_m)) continue;
    const Eigen::Vector2d place = map_from_base * seen.track->position_m;
    const bool missing = std::any_of(sights.begin(), sights.end(), [&](const Sight& other) {
      if (other.robot == own.robot) return false;
      const Eigen::Vector2d there = fleet.pose(other.robot->window.back().pose).inverse() * place;
      return inPlainSight(there) && isEmptyAround(*other.seen, there);
    });
    result.misses += missing ? 1 : 0;
  }
  for (std::size_t i = 0; i < anchors.size(); ++i) {
    const Eigen::Vector2d there = base_from_map * anchors[i].place_m;
    result.misses += !found[i] && inPlainSight(there) && isEmptyAround(*own.seen, there) ? 1 : 0;
  }
  for (const Sight& other : sights) {
    if (other.robot == own.robot) continue;
    const Pose2 there = fleet.pose(other.robot->window.back().pose).inverse() * map_from_base;
    if (!inPlainSight(there.translation())) continue;
    const bool seen = std::any_of(other.seen->begin(), other.seen->end(), [&](const Seen& s) {
      return isBody(fleet, s, *own.robot, there);
    });
    result.matches += seen ? 1 : 0;
    result.misses += !seen && isEmptyAround(*other.seen, there.translation()) ? 1 : 0;
  }
  return result;
}

/// Places in base_link where a body of this kind may stand.
std::vector<Eigen::Vector2d> bodies(const FleetState& fleet, const std::vector<Seen>& seen,
                                    const Body& body) {
  std::vector<Eigen::Vector2d> all;
  for (const Seen& s : seen) {
    const BodyFit fit = fitBody(*s.view, body, 0.0, s.track->position_m);
    if (fit.rms_m < kBodyShare * fleet.options.sighting_rms_m) all.push_back(fit.position_m);
  }
  return all;
}

void addMutual(const FleetState& fleet, const Sight& own, const std::vector<Sight>& sights,
               std::vector<Hypothesis>& hypotheses) {
  for (const Sight& other : sights) {
    if (other.robot == own.robot) continue;
    const Pose2 map_from_other = fleet.pose(other.robot->window.back().pose);
    const auto of_other = bodies(fleet, *own.seen, *other.robot->body);
    for (const Eigen::Vector2d& p : bodies(fleet, *other.seen, *own.robot->body)) {
      const Eigen::Vector2d place = map_from_other * p, back = map_from_other.translation() - place;
      for (const Eigen::Vector2d& q : of_other) {
        if (std::abs(q.norm() - p.norm()) > kSameDistance_m) continue;
        const double theta = wrapAngle(std::atan2(back.y(), back.x()) - std::atan2(q.y(), q.x()));
        hypotheses.push_back({{place.x(), place.y(), theta}, {}});
      }
    }
  }
}

void addConstellations(const Sight& own, const std::vector<Anchor>& anchors,
                       std::vector<Hypothesis>& hypotheses) {
  std::vector<Footprint> seen;
  for (const Seen& s : *own.seen) {
    if (s.mature) seen.emplace_back(*s.view);
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t j = i + 1; j < seen.size(); ++j) {
      for (const Anchor& a : anchors) {
        for (const Anchor& b : anchors) {
          const Eigen::Vector2d from = seen[i].centre(a.height_m), to = seen[j].centre(b.height_m);
          const Eigen::Vector2d base = to - from, map = b.place_m - a.place_m;
          if (&a == &b || base.norm() < kLeastBase_m ||
              std::abs(base.norm() - map.norm()) > kSameDistance_m)
            continue;
          const double theta = wrapAngle(std::atan2(map.y(), map.x()) - std::atan2(base.y(), base.x()));
          const Eigen::Vector2d t =
              0.5 * (a.place_m + b.place_m) - Eigen::Rotation2Dd(theta) * Eigen::Vector2d(0.5 * (from + to));
          hypotheses.push_back({{t.x(), t.y(), theta}, {}});
        }
      }
    }
  }
}

bool same(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() < kSame_m &&
         std::abs(wrapAngle(a.theta_rad - b.theta_rad)) < kSame_rad;
}

/// Two robots do not err alike by chance: where one has been found to have started elsewhere, or to be
/// estimated elsewhere by now, the same error of another is the error of what told them both.
bool errsLikeAnother(const FleetState& fleet, const RobotNode& robot, const Pose2& moved, const Pose2& claim) {
  return std::any_of(fleet.robots.begin(), fleet.robots.end(), [&](const RobotNode& other) {
    const Pose2 here = moved * robot.start.moved * claim;
    return &other != &robot && !same(claim, other.start.moved * claim) && same(here, other.start.moved * claim);
  });
}

std::vector<Hypothesis> hypothesesOf(const FleetState& fleet, const Sight& own,
                                     const std::vector<Anchor>& anchors, const std::vector<Sight>& sights) {
  std::vector<Hypothesis> all, distinct;
  addMutual(fleet, own, sights, all);
  addConstellations(own, anchors, all);
  for (Hypothesis& h : all) h.agreement = agreementAt(fleet, own, h.map_from_base, anchors, sights);
  std::stable_sort(all.begin(), all.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return a.agreement.score() > b.agreement.score();
  });
  for (const Hypothesis& h : all) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Hypothesis& other) {
      return same(h.map_from_base, other.map_from_base);
    });
    if (!known && h.agreement.score() > 0) distinct.push_back(h);
  }
  return distinct;
}

/// Sums up what one frame says for other places.
void weighElsewhere(const FleetState& fleet, const Sight& own, const std::vector<Hypothesis>& hypotheses) {
  Start& start = own.robot->start;
  const Pose2 claim = fleet.pose(own.robot->window.back().pose);
  std::vector<bool> taken(start.elsewhere.size(), false);
  for (const Hypothesis& h : hypotheses) {
    const Pose2 moved = h.map_from_base * claim.inverse();
    const double score = h.agreement.score() + (errsLikeAnother(fleet, *own.robot, moved, claim) ? 2.0 : 0.0);
    std::size_t i = 0;
    while (i < taken.size() && (taken[i] || !same(start.elsewhere[i].moved * claim, h.map_from_base))) ++i;
    if (i < taken.size()) {
      start.elsewhere[i].score += score;
      start.elsewhere[i].moved = moved;
      taken[i] = true;
    } else if (start.elsewhere.size() < kMostElsewhere) {
      start.elsewhere.push_back({moved, score});
    }
  }
}

void forgetDoubts(Start& start) {
  start.doubted = start.refuted = 0;
  start.claim_score = 0.0;
  start.elsewhere.clear();
}

void weigh(FleetState& fleet, const Sight& own, const std::vector<Sight>& sights) {
  Start& start = own.robot->start;
  const auto anchors = anchorsFor(fleet, *own.robot, own.objects->acquired_ns);
  const Pose2 claim = fleet.pose(own.robot->window.back().pose);
  const Agreement here = agreementAt(fleet, own, claim, anchors, sights);
  if (here.matches >= 2 && here.matches >= 2 * here.misses) {
    ++start.agreed;
    forgetDoubts(start);
    return;
  }
  const bool refuted = here.misses >= 2 && here.misses > here.matches;
  if (!refuted && here.matches > 0) return;
  ++start.doubted;
  start.refuted += refuted ? 1 : 0;
  start.claim_score += here.score();
  weighElsewhere(fleet, own, hypothesesOf(fleet, own, anchors, sights));
}

/// Where a robot is much rather than where it is said to be; nullptr: that cannot be said.
const OtherStart* decided(const Start& start) {
  if (start.doubted < kFrames || start.elsewhere.empty()) return nullptr;
  const auto best = std::max_element(start.elsewhere.begin(), start.elsewhere.end(),
                                     [](const auto& a, const auto& b) { return a.score < b.score; });
  double rival = start.claim_score;
  for (const OtherStart& other : start.elsewhere) {
    if (&other != &*best) rival = std::max(rival, other.score + (kLead - kRivalLead) * start.doubted);
  }
  const bool refuted = 2 * start.refuted >= start.doubted;
  const double enough = (refuted ? kRefuted : kUnseen) * start.doubted;
  return best->score >= enough && best->score >= rival + kLead * start.doubted ? &*best : nullptr;
}

void removeLandmarks(FleetState& fleet, const RobotNode& robot, const Eigen::Vector2d& place_m) {
  std::vector<std::uint32_t> gone;
  for (const auto& [id, landmark] : fleet.landmarks) {
    const bool own = landmark.seen_ns.size() == 1 && landmark.seen_ns.count(robot.setup.name) > 0;
    const bool is_it = (fleet.centre(landmark) - place_m).norm() < robot.body->reach() + kMatch_m;
    if (own || is_it) gone.push_back(id);
  }
  for (const std::uint32_t id : gone) fleet.removeLandmark(id);
}

void placeAnew(FleetState& fleet, const Sight& sight, const Pose2& moved, const Eigen::Matrix3d& covariance) {
  RobotNode& robot = *sight.robot;
  const Pose2 place = moved * fleet.pose(robot.window.back().pose);
  fleet.release(robot);
  fleet.place(robot, *sight.objects, place);
  robot.covariance = covariance;
  Step& step = robot.window.back();
  fleet.graph.addFactor(absolutePoseFactor(place, covariance), {step.pose});
  Start& start = robot.start;
  start.moved = moved * start.moved;
  start.pose = 0;
  start.anchor = step.pose;
  start.anchored = place;
  for (PoseEstimate& told : start.history) told.map_from_base = moved * told.map_from_base;
  fleet.revised.insert(fleet.revised.end(), start.history.begin(), start.history.end());
}

/// Where more robots are now beside their starts by one and the same motion than are where they should be,
/// that motion is the error: the map goes back by it.
void moveMap(FleetState& fleet, const std::vector<Sight>& sights) {
  const auto located = std::count_if(fleet.robots.begin(), fleet.robots.end(),
                                     [](const RobotNode& robot) { return robot.located(); });
  if (static_cast<std::size_t>(located) != sights.size()) return;
  const auto alike = [&](const Pose2& moved) {
    return std::count_if(sights.begin(), sights.end(), [&](const Sight& sight) {
      const Pose2 told = sight.robot->start.told;
      return same(moved * told, sight.robot->start.moved * told);
    });
  };
  const auto right = alike(Pose2{});
  for (const Sight& sight : sights) {
    const Pose2 moved = sight.robot->start.moved;
    if (alike(moved) <= right) continue;
    std::vector<std::uint32_t> all;
    for (const auto& [id, landmark] : fleet.landmarks) all.push_back(id);
    for (const std::uint32_t id : all) fleet.removeLandmark(id);
    for (const Sight& each : sights) placeAnew(fleet, each, moved.inverse(), each.robot->covariance);
    return;
  }
}

}  // namespace

bool isConfirmed(const Start& start) {
  return start.agreed >= kConfirmed;
}

std::string tellMoved(const Pose2& moved, const Pose2& told) {
  const Pose2 by = told.inverse() * moved * told;
  char line[128];
  std::snprintf(line, sizeof line, "started %.2f m and %.1f degrees beside its initial_pose (%.3f, %.3f, %.3f)",
                by.translation().norm(), std::abs(by.theta_rad) * 180.0 / M_PI, (moved * told).x_m,
                (moved * told).y_m, wrapAngle((moved * told).theta_rad));
  return line;
}

std::vector<RobotNode*> checkStarts(FleetState& fleet, const std::vector<Sight>& sights) {
  if (fleet.tied || sights.size() < 2) return {};
  const Sight* wrong = nullptr;
  double most = 0.0;
  for (const Sight& own : sights) {
    Start& start = own.robot->start;
    if (isConfirmed(start)) continue;
    weigh(fleet, own, sights);
    const OtherStart* other = decided(start);
    if (other == nullptr || other->score / start.doubted < most) continue;
    most = other->score / start.doubted;
    wrong = &own;
  }
  if (wrong == nullptr) return {};
  RobotNode& robot = *wrong->robot;
  const Pose2 moved = decided(robot.start)->moved;
  placeAnew(fleet, *wrong, moved,
            Eigen::Vector3d(kSigma_m * kSigma_m, kSigma_m * kSigma_m, kSigma_rad * kSigma_rad).asDiagonal());
  removeLandmarks(fleet, robot, fleet.pose(robot.window.back().pose).translation());
  moveMap(fleet, sights);
  for (const Sight& sight : sights) forgetDoubts(sight.robot->start);
  return {&robot};
}

}  // namespace omnifleet::estimation
