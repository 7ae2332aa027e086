#include "estimation/keyframe_map.h"

#include <Eigen/Cholesky>
#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace omnifleet::estimation {
namespace {

constexpr double kPairMatched = 0.5;  // share of beams that two neighbours must have in common
constexpr double kPairChi2 = 4.0;     // mean χ² above which two scans do not show the same place
constexpr double kBothNoisy = 2.0;    // both scans of a pair have noise; the match counts that of one
constexpr double kWeakest_m = 0.05;   // m; a pair that leaves more than this open in some direction says so

}  // namespace

KeyframeOptions KeyframeOptions::read(const options::Section& section) {
  KeyframeOptions o;
  section.read("spacing_m", o.spacing_m, {0.02, 10.0});
  section.read("references", o.references, {1, 64});
  section.read("reach_m", o.reach_m, {0.1, 100.0});
  section.read("pair_reach_m", o.pair_reach_m, {0.05, 100.0});
  section.read("min_lines", o.min_lines, {10, 1440});
  section.read("sigma_m", o.sigma_m, {0.0, 1.0});
  section.read("sigma_per_m2", o.sigma_per_m2, {0.0, 1.0});
  section.read("sigma_rad", o.sigma_rad, {0.0, 0.1});
  section.read("sigma_rad_per_m2", o.sigma_rad_per_m2, {0.0, 0.1});
  section.finish();
  return o;
}

std::vector<KeyframeMap::Id> KeyframeMap::near(const Pose2& map_from_base) const {
  std::vector<std::pair<double, Id>> by_distance;
  for (Id k = 0; k < keyframes_.size(); ++k) {
    const double distance = (graph_.pose(k).translation() - map_from_base.translation()).norm();
    if (distance <= options_.reach_m) by_distance.emplace_back(distance, k);
  }
  const auto count = std::min(by_distance.size(), static_cast<std::size_t>(options_.references));
  std::partial_sort(by_distance.begin(), by_distance.begin() + static_cast<std::ptrdiff_t>(count),
                    by_distance.end());
  std::vector<Id> ids;
  for (std::size_t i = 0; i < count; ++i) ids.push_back(by_distance[i].second);
  return ids;
}

scan::Reference KeyframeMap::reference(Id keyframe) const {
  const Keyframe& k = keyframes_[keyframe];
  return {&k.scan, graph_.pose(keyframe) * k.base_from_scan};
}

bool KeyframeMap::wants(const Pose2& map_from_base, const scan::LineScan& scan) const {
  if (scan.lines() < static_cast<std::size_t>(options_.min_lines)) return false;
  for (Id k = 0; k < keyframes_.size(); ++k)
    if ((graph_.pose(k).translation() - map_from_base.translation()).norm() < options_.spacing_m)
      return false;
  return true;
}

Eigen::Matrix3d KeyframeMap::systematic(double distance_m) const {
  const double square = distance_m * distance_m, m = options_.sigma_m + options_.sigma_per_m2 * square,
               rad = options_.sigma_rad + options_.sigma_rad_per_m2 * square;
  return Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
}

KeyframeMap::Id KeyframeMap::add(const std::string& robot, TimeNs time_ns, const Pose2& map_from_base,
                                 const Pose2& base_from_scan, const scan::LineScan& scan, const Held& held) {
  const Id id = graph_.add(map_from_base);
  keyframes_.push_back({robot, time_ns, base_from_scan, scan});
  if (held.previous)
    graph_.addRelative(*held.previous, id, held.previous_from_this, held.covariance);
  else
    graph_.addAbsolute(id, map_from_base, held.covariance);
  constrainPairs(id);
  moved_m_ = graph_.optimise();
  return id;
}

/// Relative poses to all neighbours, each by its own match.
void KeyframeMap::constrainPairs(Id id) {
  const Keyframe& added = keyframes_[id];
  const Pose2 map_from_scan = graph_.pose(id) * added.base_from_scan;
  const Eigen::Matrix3d prior = Eigen::Vector3d(1e3, 1e3, 1e4).asDiagonal();  // 3 cm, 0.6°
  for (Id k = 0; k < id; ++k) {
    const double distance_m = (graph_.pose(k).translation() - graph_.pose(id).translation()).norm();
    if (distance_m > options_.pair_reach_m) continue;
    const scan::Reference other = reference(k);
    const scan::Match match = matcher_.match(added.scan, map_from_scan, prior, {other});
    if (!match.valid || match.matched < kPairMatched || match.chi2 > kPairChi2) continue;
    const Pose2 from_to = graph_.pose(k).inverse() * match.map_from_scan * added.base_from_scan.inverse();
    // A direction that the scans leave open stays open: its variance is the prior's.
    const Eigen::Matrix3d information =
        match.information / kBothNoisy +
        Eigen::Matrix3d(Eigen::Vector3d(1.0 / (kWeakest_m * kWeakest_m), 1.0 / (kWeakest_m * kWeakest_m), 1.0)
                            .asDiagonal()) *
            1e-2;
    graph_.addRelative(k, id, from_to, information.inverse() + systematic(distance_m));
  }
}

}  // namespace omnifleet::estimation
