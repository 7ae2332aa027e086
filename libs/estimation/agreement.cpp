#include "estimation/agreement.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

namespace omnifleet::estimation {
namespace {

constexpr TimeNs kLately_ns = 300000000;  // a robot that has seen nothing since cannot be asked
constexpr double kMatch_m = 0.10;         // between a thing seen and what it should be
constexpr double kEmpty_m = 0.30;      // nothing is seen so near the place of something: it is missing there
constexpr double kTooNear_m = 0.35;    // of the camera: hidden by the own body
constexpr double kPlainSight_m = 1.2;  // of the camera: not missed there
constexpr double kSearch_m = 0.5;      // from the place of a robot to the silhouette that may be it
constexpr double kBodyShare = 0.5;     // of sighting_rms_m
constexpr double kWidth_m = 0.04, kWidthShare = 0.3;  // how much half widths may differ
constexpr double kSameDistance_m = 0.05, kLeastBase_m = 0.4;
constexpr double kSame_m = 0.12, kSame_rad = 0.12;

bool isBody(const FleetState& fleet, const Glimpse& seen, const RobotNode& robot,
            const Pose2& base_from_robot) {
  if ((seen.position_m - base_from_robot.translation()).norm() > kSearch_m) return false;
  const BodyFit fit =
      fitBody(*seen.view, *robot.body, base_from_robot.theta_rad, base_from_robot.translation());
  return fit.rms_m < kBodyShare * fleet.options.sighting_rms_m &&
         (fit.position_m - base_from_robot.translation()).norm() < kMatch_m;
}

/// Where a wall, or what stands nearer, runs into a thing it is not seen, but it is not missing either.
bool seesFloorAt(const RobotNode& robot, const Eigen::Vector2d& in_base_m) {
  const Scan& scan = robot.sight_aid.scan;
  if (scan.range_m.empty()) return true;
  const Eigen::Vector2d to = in_base_m - scan.origin_m;
  const auto rays = static_cast<double>(scan.range_m.size());
  const double turn = wrapAngle(std::atan2(to.y(), to.x())) / (2.0 * M_PI);
  const auto ray = static_cast<std::size_t>(std::lround((turn < 0.0 ? turn + 1.0 : turn) * rays));
  return scan.range_m[ray % scan.range_m.size()] > to.norm();
}

bool isEmptyAround(const RobotNode& robot, const Eigen::Vector2d& in_base_m) {
  return seesFloorAt(robot, in_base_m) &&
         std::none_of(robot.sight_aid.glimpses.begin(), robot.sight_aid.glimpses.end(),
                      [&](const Glimpse& s) { return (s.position_m - in_base_m).norm() < kEmpty_m; });
}

bool inPlainSight(const RobotNode& robot, const Eigen::Vector2d& in_base_m) {
  const double away_m = in_base_m.norm();
  return away_m > kTooNear_m && away_m < std::min(kPlainSight_m, robot.sight_aid.farthest_m);
}

bool isWhat(const FleetState& fleet, const Glimpse& seen, const Pose2& map_from_base, const Anchor& anchor) {
  if (anchor.robot != nullptr) {
    const Pose2 map_from_robot{anchor.place_m.x(), anchor.place_m.y(), anchor.theta_rad};
    return isBody(fleet, seen, *anchor.robot, map_from_base.inverse() * map_from_robot);
  }
  const Footprint& footprint = seen.footprint;
  const double width_m = footprint.half_width_m - anchor.height_m * footprint.half_width_by_height;
  return std::abs(width_m - anchor.half_width_m) < kWidth_m + kWidthShare * anchor.half_width_m &&
         (map_from_base * footprint.centre(anchor.height_m) - anchor.place_m).norm() < kMatch_m;
}

/// What the robot sees against what is known; tells which anchors it has found.
void weighSeen(const FleetState& fleet, const Surroundings& around, const Pose2& map_from_base,
               std::vector<bool>& found, Agreement& result) {
  for (const Glimpse& seen : around.robot->sight_aid.glimpses) {
    if (!seen.mature) continue;
    bool known = false;
    for (std::size_t i = 0; i < found.size() && !known; ++i) {
      known = !found[i] && isWhat(fleet, seen, map_from_base, around.anchors[i]);
      if (known) found[i] = true;
    }
    result.matches += known ? 1 : 0;
    if (known || !inPlainSight(*around.robot, seen.position_m)) continue;
    const Eigen::Vector2d place = map_from_base * seen.position_m;
    const bool missing = std::any_of(around.others.begin(), around.others.end(), [&](const Company& other) {
      const Eigen::Vector2d there = other.map_from_base.inverse() * place;
      return inPlainSight(*other.robot, there) && isEmptyAround(*other.robot, there);
    });
    result.misses += missing ? 1 : 0;
  }
}

void addMutual(const FleetState& fleet, const Surroundings& around, std::vector<Hypothesis>& hypotheses) {
  for (const Company& other : around.others) {
    const auto of_other = bodies(fleet, *around.robot, *other.robot->body);
    for (const Eigen::Vector2d& p : bodies(fleet, *other.robot, *around.robot->body)) {
      const Eigen::Vector2d place = other.map_from_base * p;
      const Eigen::Vector2d back = other.map_from_base.translation() - place;
      for (const Eigen::Vector2d& q : of_other) {
        if (std::abs(q.norm() - p.norm()) > kSameDistance_m) continue;
        const double theta = wrapAngle(std::atan2(back.y(), back.x()) - std::atan2(q.y(), q.x()));
        hypotheses.push_back({Pose2{place.x(), place.y(), theta} * other.way.inverse(), {}});
      }
    }
  }
}

void addConstellations(const Surroundings& around, std::vector<Hypothesis>& hypotheses) {
  std::vector<Footprint> seen;
  for (const Glimpse& s : around.robot->sight_aid.glimpses) {
    if (s.mature) seen.push_back(s.footprint);
  }
  for (std::size_t i = 0; i < seen.size(); ++i) {
    for (std::size_t j = i + 1; j < seen.size(); ++j) {
      for (const Anchor& a : around.anchors) {
        for (const Anchor& b : around.anchors) {
          const Eigen::Vector2d from = seen[i].centre(a.height_m), to = seen[j].centre(b.height_m);
          const Eigen::Vector2d base = to - from, map = b.place_m - a.place_m;
          if (&a == &b || base.norm() < kLeastBase_m || std::abs(base.norm() - map.norm()) > kSameDistance_m)
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

std::vector<Anchor> anchorsFor(const FleetState& fleet, const RobotNode& robot) {
  std::vector<Anchor> all;
  for (const auto& [id, landmark] : fleet.landmarks) {
    bool of_others = false, sure = false;
    for (const auto& [name, observer] : landmark.observers) {
      if (name == robot.setup.name) continue;
      of_others = true;
      sure = sure || observer.isSure();
    }
    if (!of_others) continue;
    double width_m, width_by_height;
    landmark.shape->halfWidth(width_m, width_by_height);
    const double height_m = fleet.height(landmark);
    all.push_back(
        {fleet.centre(landmark), height_m, width_m - height_m * width_by_height, nullptr, 0.0, sure});
  }
  for (const RobotNode& other : fleet.robots) {
    const auto at = fleet.poseAt(other, robot.sight_aid.time_ns);
    if (&other == &robot || !at || other.doubt.displaced || other.body->reach() <= 0) continue;
    all.push_back({at->map_from_base.translation(), other.body->height(), other.body->reach(), &other,
                   at->map_from_base.theta_rad, true});
  }
  return all;
}

}  // namespace

Surroundings Surroundings::of(const FleetState& fleet, const RobotNode& robot) {
  Surroundings around{&robot, anchorsFor(fleet, robot), {}};
  const Pose2 base_from_map = fleet.pose(robot.window.back().pose).inverse();
  for (const RobotNode& other : fleet.robots) {
    if (&other == &robot || !other.located() ||
        robot.sight_aid.time_ns - other.sight_aid.time_ns > kLately_ns)
      continue;
    const auto there = fleet.poseAt(other, other.sight_aid.time_ns),
               own = fleet.poseAt(robot, other.sight_aid.time_ns);
    if (there && own)
      around.others.push_back({&other, there->map_from_base, base_from_map * own->map_from_base});
  }
  return around;
}

Agreement agreementAt(const FleetState& fleet, const Surroundings& around, const Pose2& map_from_base) {
  Agreement result;
  std::vector<bool> found(around.anchors.size(), false);
  weighSeen(fleet, around, map_from_base, found, result);
  const Pose2 base_from_map = map_from_base.inverse();
  for (std::size_t i = 0; i < found.size(); ++i) {
    const Eigen::Vector2d there = base_from_map * around.anchors[i].place_m;
    result.misses += !found[i] && around.anchors[i].sure && inPlainSight(*around.robot, there) &&
                             isEmptyAround(*around.robot, there)
                         ? 1
                         : 0;
  }
  for (const Company& other : around.others) {
    const Pose2 there = other.map_from_base.inverse() * map_from_base * other.way;
    if (around.robot->body->reach() <= 0 || !inPlainSight(*other.robot, there.translation())) continue;
    const auto& sight = other.robot->sight_aid.glimpses;
    const bool seen = std::any_of(sight.begin(), sight.end(),
                                  [&](const Glimpse& s) { return isBody(fleet, s, *around.robot, there); });
    result.matches += seen ? 1 : 0;
    result.misses += !seen && isEmptyAround(*other.robot, there.translation()) ? 1 : 0;
  }
  return result;
}

std::vector<Hypothesis> otherPlaces(const FleetState& fleet, const Surroundings& around) {
  std::vector<Hypothesis> all, distinct;
  addMutual(fleet, around, all);
  addConstellations(around, all);
  for (Hypothesis& h : all) h.agreement = agreementAt(fleet, around, h.map_from_base);
  std::stable_sort(all.begin(), all.end(), [](const Hypothesis& a, const Hypothesis& b) {
    return a.agreement.score() > b.agreement.score();
  });
  for (const Hypothesis& h : all) {
    const bool known = std::any_of(distinct.begin(), distinct.end(), [&](const Hypothesis& other) {
      return areSame(h.map_from_base, other.map_from_base);
    });
    if (!known && h.agreement.score() > 0) distinct.push_back(h);
  }
  return distinct;
}

std::vector<Eigen::Vector2d> bodies(const FleetState& fleet, const RobotNode& observer, const Body& body) {
  std::vector<Eigen::Vector2d> all;
  for (const Glimpse& s : observer.sight_aid.glimpses) {
    const BodyFit fit = fitBody(*s.view, body, 0.0, s.position_m);
    if (fit.rms_m < kBodyShare * fleet.options.sighting_rms_m) all.push_back(fit.position_m);
  }
  return all;
}

bool isMissing(const RobotNode& robot, const Eigen::Vector2d& in_base_m) {
  return inPlainSight(robot, in_base_m) && isEmptyAround(robot, in_base_m);
}

bool areSame(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm() < kSame_m &&
         std::abs(wrapAngle(a.theta_rad - b.theta_rad)) < kSame_rad;
}

}  // namespace omnifleet::estimation
