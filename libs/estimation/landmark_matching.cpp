#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>
#include <tuple>

#include "estimation/association.h"
#include "estimation/jumps.h"

namespace omnifleet::estimation {
namespace {

constexpr double kPlace_m = 0.05;      // σ of a single view's centre once the height is right
constexpr double kHeightSigmas = 3.0;  // how far the height may be bent to bring two centres together
constexpr double kWidth_m = 0.04, kWidthShare = 0.3;  // how much half widths may differ

/// How well a view and a landmark go together.
struct Match {
  double distance_m;  ///< between the centres at the best height
  double height_m;
  bool possible;  ///< the height and the sizes allow it
};

Match match(const FleetState& fleet, const Landmark& landmark, const View& view, const Footprint& footprint,
            const Pose2& map_from_base) {
  Eigen::Vector2d mark_at, mark_by_height;
  landmark.shape->centre(mark_at, mark_by_height);
  const Pose2 map_from_mark = fleet.mapFromLandmark(landmark);
  const Eigen::Vector2d apart = map_from_base * footprint.centre_m - map_from_mark * mark_at;
  const Eigen::Vector2d slope =
      map_from_base.rotation() * footprint.centre_by_height - map_from_mark.rotation() * mark_by_height;
  // Least squares in h: (apart − h·slope)/σ and the two priors.
  const double known = fleet.height(landmark), variance = landmark.covariance(2, 2) + 1e-4;
  double h = known, weight = slope.squaredNorm() / (kPlace_m * kPlace_m) + 1.0 / variance;
  double rhs = slope.dot(apart) / (kPlace_m * kPlace_m) + known / variance;
  if (view.height_sigma_m > 0) {
    const double own = view.height_sigma_m * view.height_sigma_m + 4e-4;
    weight += 1.0 / own;
    rhs += view.height_m / own;
  }
  h = rhs / weight;
  if (view.camera_height_m > 0) h = std::clamp(h, 0.0, 0.95 * view.camera_height_m);
  double width, width_by_height;
  landmark.shape->halfWidth(width, width_by_height);
  width -= h * width_by_height;
  const double seen_width = footprint.half_width_m - h * footprint.half_width_by_height;
  Match m{(apart - h * slope).norm(), h, true};
  m.possible = std::abs(h - known) < kHeightSigmas * std::sqrt(variance) &&
               std::abs(width - seen_width) < kWidth_m + kWidthShare * width;
  return m;
}

struct Candidate {
  double distance_m;
  std::size_t seen;
  std::uint32_t landmark;
  bool operator<(const Candidate& o) const {
    return std::tie(distance_m, seen, landmark) < std::tie(o.distance_m, o.seen, o.landmark);
  }
};

bool moving(const Seen& seen, const EstimatorOptions& options) {
  return seen.track->velocity_mps.norm() > options.moving_mps;
}

}  // namespace

void matchLandmarks(FleetState& fleet, RobotNode& observer, std::vector<Seen>& seen) {
  const Pose2 map_from_base = fleet.pose(observer.window.back().pose);
  std::vector<Candidate> candidates;
  for (std::size_t s = 0; s < seen.size(); ++s) {
    if (seen[s].peer != nullptr || !seen[s].informative || moving(seen[s], fleet.options)) continue;
    const Footprint footprint(*seen[s].view);
    const auto before = observer.track_aid.known.find(seen[s].track->id);
    for (const auto& [id, landmark] : fleet.landmarks) {
      const Match m = match(fleet, landmark, *seen[s].view, footprint, map_from_base);
      // A track that was this landmark before may stray a little farther.
      const bool same = before != observer.track_aid.known.end() && before->second.landmark == id;
      if (m.possible && m.distance_m < fleet.options.associate_gate_m * (same ? 1.5 : 1.0)) {
        candidates.push_back({m.distance_m, s, id});
      }
    }
  }
  std::sort(candidates.begin(), candidates.end());
  std::set<std::uint32_t> taken;
  for (const Candidate& c : candidates) {
    if (seen[c.seen].landmark != 0 || !taken.insert(c.landmark).second) continue;
    seen[c.seen].landmark = c.landmark;
    observer.track_aid.known[seen[c.seen].track->id] = {c.landmark, 0};
  }
}

namespace {

bool farFromEverything(const FleetState& fleet, const RobotNode& observer, const View& view,
                       const Footprint& footprint, const Eigen::Vector2d& centre) {
  const Step& step = observer.window.back();
  for (const auto& [id, landmark] : fleet.landmarks) {
    if ((centre - fleet.centre(landmark)).norm() < fleet.options.new_landmark_m) return false;
    const Match m = match(fleet, landmark, view, footprint, fleet.pose(step.pose));
    if (m.distance_m < fleet.options.associate_gate_m && m.possible) return false;
  }
  for (const RobotNode& robot : fleet.robots) {
    const auto at = fleet.poseAt(robot, step.time_ns);
    if (&robot == &observer || !at) continue;
    if ((centre - at->map_from_base.translation()).norm() < fleet.options.new_landmark_robot_m) return false;
  }
  return true;
}

}  // namespace

void foundLandmarks(FleetState& fleet, RobotNode& observer, std::vector<Seen>& seen) {
  const Step& step = observer.window.back();
  if (!step.keyframe || observer.doubt.unsure > 0 || observer.doubt.displaced) return;
  const EstimatorOptions& o = fleet.options;
  const Pose2 map_from_base = fleet.pose(step.pose);
  for (Seen& s : seen) {
    if (s.peer != nullptr || s.landmark != 0 || !s.informative || s.track->kind == ObjectKind::kRobot)
      continue;
    if (moving(s, o) || (s.track->contact_m - s.view->foot_m).norm() > o.new_landmark_contact_m) continue;
    const bool measured = s.view->height_sigma_m > 0 && s.view->height_sigma_m < o.prior_height_sigma_m;
    const double height = measured ? s.view->height_m : o.prior_height_m;
    const double sigma = measured ? s.view->height_sigma_m : o.prior_height_sigma_m;
    const Footprint footprint(*s.view);
    const Eigen::Vector2d centre = map_from_base * footprint.centre(height);
    if (!farFromEverything(fleet, observer, *s.view, footprint, centre)) continue;
    Landmark& landmark = fleet.addLandmark(centre, height, sigma);
    landmark.covariance = Eigen::Vector3d(1e-4, 1e-4, sigma * sigma).asDiagonal();
    landmark.shape->begin(1.0);
    landmark.shape->add(*s.view, fleet.mapFromLandmark(landmark).inverse() * map_from_base, height);
    landmark.shape->finish();
    s.landmark = landmark.id;
    observer.track_aid.known[s.track->id] = {landmark.id, 0};
  }
}

Pose2 rigidMotion(const std::vector<Eigen::Vector2d>& from, const std::vector<Eigen::Vector2d>& to,
                  double heading_rad) {
  Eigen::Vector2d from_mean(0, 0), to_mean(0, 0);
  const double n = static_cast<double>(from.size());
  for (std::size_t i = 0; i < from.size(); ++i) from_mean += from[i] / n, to_mean += to[i] / n;
  double c = 0.0, s = 0.0;
  for (std::size_t i = 0; i < from.size(); ++i) {
    const Eigen::Vector2d a = from[i] - from_mean, b = to[i] - to_mean;
    c += a.dot(b);
    s += a.x() * b.y() - a.y() * b.x();
  }
  const double theta = std::hypot(c, s) > 0.05 ? std::atan2(s, c) : heading_rad;
  const Eigen::Vector2d t = to_mean - Eigen::Rotation2Dd(theta) * from_mean;
  return {t.x(), t.y(), theta};
}

void alignByTracks(FleetState& fleet, RobotNode& observer, const Objects& frame,
                   const std::vector<Seen>& seen) {
  constexpr double kSure_m = 0.05, kArm_m = 1.5, kAgree_m = 0.10, kHeadingKnown_rad = 0.3;
  constexpr double kCarried = 20.0;  // χ² (3 dof, 2e-4)
  const double spread = std::sqrt(observer.covariance.topLeftCorner<2, 2>().trace()) +
                        kArm_m * std::sqrt(observer.covariance(2, 2));
  Step& step = observer.window.back();
  if (spread < kSure_m || step.motion == kNoFactor) return;
  std::vector<Eigen::Vector2d> in_base, in_map;
  for (const Seen& s : seen) {
    const auto before = observer.track_aid.known.find(s.track->id);
    if (before == observer.track_aid.known.end() || !s.informative) continue;
    if (before->second.landmark != 0) {
      const auto landmark = fleet.landmarks.find(before->second.landmark);
      if (landmark == fleet.landmarks.end()) continue;
      in_base.push_back(Footprint(*s.view).centre(fleet.height(landmark->second)));
      in_map.push_back(fleet.centre(landmark->second));
    } else {
      const RobotNode& peer = fleet.robots[before->second.robot];
      const auto at = fleet.poseAt(peer, frame.acquired_ns);
      if (!at || !peer.window.back().isMeasured()) continue;  // no surer than we are
      in_base.push_back(Footprint(*s.view).centre(peer.body->height()));
      in_map.push_back(at->map_from_base.translation());
    }
  }
  // One thing tells no heading.
  if (in_base.empty() || (in_base.size() < 2 && std::sqrt(observer.covariance(2, 2)) > kHeadingKnown_rad))
    return;
  Eigen::VectorXd& value = fleet.graph.value(step.pose);
  const Pose2 placed = rigidMotion(in_base, in_map, value(2));
  for (std::size_t i = 0; i < in_base.size(); ++i) {
    if ((placed * in_base[i] - in_map[i]).norm() > kAgree_m) return;
  }
  // Wheels that say otherwise would pull the solution between the two, where it fits neither.
  const Eigen::Vector3d off = (fleet.pose(step.pose).inverse() * placed).vector();
  if (in_base.size() >= 2 && off.dot(observer.covariance.ldlt().solve(off)) > kCarried) {
    jumpTo(fleet, observer, placed);
    return;
  }
  value.head<2>() = placed.translation();
  value(2) += wrapAngle(placed.theta_rad - value(2));
}

}  // namespace omnifleet::estimation
