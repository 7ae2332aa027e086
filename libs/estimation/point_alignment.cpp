#include "estimation/point_alignment.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr TimeNs kMemory_ns = 30000000000;
constexpr std::size_t kMostPairs = 60;
constexpr std::size_t kLeastPairs = 5;
constexpr double kShare = 0.6;        // of the pairs that must agree
constexpr double kAgree_m = 0.35;     // a single range is uncertain by a tenth of itself before calibration
constexpr double kBase_m = 0.5;       // two places nearer than this do not tell a heading
constexpr double kPlace_m = 0.2;      // σ of one pair
constexpr double kHeading_rad = 0.1;  // largest σ of the heading that is accepted
constexpr double kSame_m = 0.1;       // places in map nearer than this are of one thing

using Pairs = std::deque<ScoutPair>;

/// Least squares over the pairs chosen.
Pose2 rigid(const Pairs& pairs, const std::vector<std::size_t>& chosen) {
  Eigen::Vector2d local_mean(0, 0), map_mean(0, 0);
  const double n = static_cast<double>(chosen.size());
  for (const std::size_t i : chosen) local_mean += pairs[i].in_local / n, map_mean += pairs[i].in_map / n;
  double c = 0.0, s = 0.0;
  for (const std::size_t i : chosen) {
    const Eigen::Vector2d a = pairs[i].in_local - local_mean, b = pairs[i].in_map - map_mean;
    c += a.dot(b);
    s += a.x() * b.y() - a.y() * b.x();
  }
  const double theta = std::atan2(s, c);
  const Eigen::Vector2d t = map_mean - Eigen::Rotation2Dd(theta) * local_mean;
  return {t.x(), t.y(), theta};
}

std::vector<std::size_t> supporters(const Pairs& pairs, const Pose2& map_from_local) {
  std::vector<std::size_t> all;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if ((map_from_local * pairs[i].in_local - pairs[i].in_map).norm() < kAgree_m) all.push_back(i);
  }
  return all;
}

/// What is wrong with a sight of a thing is wrong with its next one: the sights of one thing together count
/// as one.
double sights(const Pairs& pairs, const std::vector<std::size_t>& chosen, const ScoutPair& one) {
  return static_cast<double>(std::count_if(chosen.begin(), chosen.end(), [&](std::size_t j) {
    return (one.in_map - pairs[j].in_map).norm() < kSame_m;
  }));
}

/// How well the pairs chosen tell the pose (right perturbation).
Eigen::Matrix3d information(const Pairs& pairs, const std::vector<std::size_t>& chosen,
                            const Pose2& base_from_local) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const std::size_t i : chosen) {
    const Eigen::Vector2d p = base_from_local * pairs[i].in_local;
    Eigen::Matrix<double, 2, 3> by_pose;
    by_pose << Eigen::Matrix2d::Identity(), Eigen::Vector2d(-p.y(), p.x());
    const double variance_m2 = kPlace_m * kPlace_m + pairs[i].map_variance_m2;
    sum += by_pose.transpose() * by_pose / (variance_m2 * sights(pairs, chosen, pairs[i]));
  }
  return sum;
}

std::vector<std::size_t> consensus(const Pairs& pairs) {
  std::vector<std::size_t> best;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    for (std::size_t j = i + 1; j < pairs.size(); ++j) {
      const double local = (pairs[j].in_local - pairs[i].in_local).norm();
      const double map = (pairs[j].in_map - pairs[i].in_map).norm();
      if (local < kBase_m || map < kBase_m || std::abs(local - map) > kAgree_m) continue;
      std::vector<std::size_t> agree = supporters(pairs, rigid(pairs, {i, j}));
      if (agree.size() > best.size()) best = std::move(agree);
    }
  }
  return best;
}

/// Ties a robot just placed to what the pairs chosen are of. What lies some time back is taken as a place
/// beside the robot that was there then: its way since is short against kPlace_m.
void tie(FleetState& fleet, RobotNode& placed, const Pairs& pairs, const std::vector<std::size_t>& chosen,
         const Pose2& base_from_local) {
  const VariableId pose = placed.window.back().pose;
  for (const std::size_t i : chosen) {
    const Eigen::Vector2d in_base = base_from_local * pairs[i].in_local;
    const double sigma_m = kPlace_m * std::sqrt(sights(pairs, chosen, pairs[i]));
    const auto point = fleet.points.find(pairs[i].of);
    const RobotNode* peer = fleet.find(pairs[i].of);
    if (point != fleet.points.end()) {
      fleet.graph.addFactor(pointInBaseFactor(in_base, sigma_m), {pose, point->second.variable});
    } else if (peer != nullptr && peer->located()) {
      const VariableId other = peer->window.back().pose;
      const Eigen::Vector2d in_other = fleet.pose(other).inverse() * pairs[i].in_map;
      fleet.graph.addFactor(placeInBaseFactor(in_base, sigma_m, in_other), {pose, other});
    }
  }
}

}  // namespace

void advanceScout(const FleetState& fleet, RobotNode& lost, const Objects& frame) {
  if (!lost.scout) lost.scout.emplace();
  Scout& scout = *lost.scout;
  Pose2 motion;
  if (!fleet.motionBetween(lost, scout.time_ns, frame, motion)) {
    scout.pairs.clear();
    scout.guess.reset();
    motion = {};
  }
  scout.local_from_base = scout.local_from_base * motion;
  scout.time_ns = frame.acquired_ns;
  while (!scout.pairs.empty() && scout.pairs.front().time_ns < frame.acquired_ns - kMemory_ns)
    scout.pairs.pop_front();
}

void addScoutPair(RobotNode& lost, const std::string& of, const Eigen::Vector2d& in_local,
                  const Eigen::Vector2d& in_map, const Eigen::Matrix2d& map_covariance) {
  lost.scout->pairs.push_back({lost.scout->time_ns, of, in_local, in_map, 0.5 * map_covariance.trace()});
  if (lost.scout->pairs.size() > kMostPairs) lost.scout->pairs.pop_front();
}

bool locateByPoints(FleetState& fleet, RobotNode& lost, const Objects& frame) {
  if (!lost.scout || lost.scout->pairs.size() < kLeastPairs || lost.scout->time_ns != frame.acquired_ns)
    return false;
  const Pairs& pairs = lost.scout->pairs;
  std::vector<std::size_t> agree = consensus(pairs);
  if (agree.size() < kLeastPairs) return false;
  agree = supporters(pairs, rigid(pairs, agree));
  if (agree.size() < kLeastPairs ||
      static_cast<double>(agree.size()) < kShare * static_cast<double>(pairs.size()))
    return false;
  const Pose2& local_from_base = lost.scout->local_from_base;
  const Eigen::Matrix3d gained = information(pairs, agree, local_from_base.inverse());
  const Eigen::LLT<Eigen::Matrix3d> root(gained);
  if (root.info() != Eigen::Success) return false;
  const Eigen::Matrix3d covariance = root.solve(Eigen::Matrix3d::Identity());
  if (!(covariance(2, 2) <= kHeading_rad * kHeading_rad)) return false;
  const Scout scout = *lost.scout;  // place() lets it go
  fleet.place(lost, frame, rigid(scout.pairs, agree) * scout.local_from_base);
  lost.covariance = covariance;
  tie(fleet, lost, scout.pairs, agree, scout.local_from_base.inverse());
  return true;
}

}  // namespace omnifleet::estimation
