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

/// How well the pairs chosen tell the pose (right perturbation). What is wrong with a sight of a thing is
/// wrong with its next one: the sights of one thing together count as one.
Eigen::Matrix3d information(const Pairs& pairs, const std::vector<std::size_t>& chosen,
                            const Pose2& base_from_local) {
  Eigen::Matrix3d sum = Eigen::Matrix3d::Zero();
  for (const std::size_t i : chosen) {
    int sights = 0;
    for (const std::size_t j : chosen) sights += (pairs[i].in_map - pairs[j].in_map).norm() < kSame_m ? 1 : 0;
    const Eigen::Vector2d p = base_from_local * pairs[i].in_local;
    Eigen::Matrix<double, 2, 3> by_pose;
    by_pose << Eigen::Matrix2d::Identity(), Eigen::Vector2d(-p.y(), p.x());
    sum += by_pose.transpose() * by_pose / ((kPlace_m * kPlace_m + pairs[i].map_variance_m2) * sights);
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

}  // namespace

void advanceScout(const FleetState& fleet, RobotNode& lost, const Objects& frame) {
  if (!lost.scout) lost.scout.emplace();
  Scout& scout = *lost.scout;
  Pose2 motion;
  if (!fleet.motionBetween(lost, scout.time_ns, frame, motion)) {
    scout.pairs.clear();
    motion = {};
  }
  scout.local_from_base = scout.local_from_base * motion;
  scout.time_ns = frame.acquired_ns;
  while (!scout.pairs.empty() && scout.pairs.front().time_ns < frame.acquired_ns - kMemory_ns)
    scout.pairs.pop_front();
}

void addScoutPair(RobotNode& lost, const Eigen::Vector2d& in_local, const Eigen::Vector2d& in_map,
                  const Eigen::Matrix2d& map_covariance) {
  lost.scout->pairs.push_back({lost.scout->time_ns, in_local, in_map, 0.5 * map_covariance.trace()});
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
  const Eigen::Matrix3d told = information(pairs, agree, local_from_base.inverse());
  const Eigen::LLT<Eigen::Matrix3d> root(told);
  if (root.info() != Eigen::Success) return false;
  const Eigen::Matrix3d covariance = root.solve(Eigen::Matrix3d::Identity());
  if (!(covariance(2, 2) <= kHeading_rad * kHeading_rad)) return false;
  const Pose2 map_from_base = rigid(pairs, agree) * local_from_base;
  fleet.place(lost, frame, map_from_base);
  lost.covariance = covariance;
  fleet.graph.addFactor(absolutePoseFactor(map_from_base, covariance), {lost.window.back().pose});
  return true;
}

}  // namespace omnifleet::estimation
