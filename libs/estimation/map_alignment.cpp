#include "estimation/map_alignment.h"

#include <fmt/format.h>

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::estimation {
namespace {

constexpr double kEverywhere_m = 1e3;
constexpr double kSame_m = 0.25, kSame_rad = 0.15;     // relations that are one, at the middle of the own map
constexpr double kInlier_m = 0.1, kInlier_rad = 0.06;  // of what a keyframe says about a relation
constexpr double kMaxChi2 = 6.0;
constexpr int kRefinements = 3;
constexpr std::size_t kNearest = 3;  // scans of the map that one of the own is matched with
const Eigen::Matrix3d kLoose = Eigen::Vector3d(100.0, 100.0, 400.0).asDiagonal();  // 10 cm, 3°

double median(std::vector<double>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

Eigen::Vector2d middleOf(const KeyframeMap& map) {
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();
  for (KeyframeMap::Id k = 0; k < map.size(); ++k) sum += map.pose(k).translation();
  return map.size() > 0 ? Eigen::Vector2d(sum / static_cast<double>(map.size())) : sum;
}

/// At most `most` of some keyframes, far from each other (farthest-point sampling from the first one).
std::vector<KeyframeMap::Id> spread(const KeyframeMap& map, const std::vector<KeyframeMap::Id>& of,
                                    std::size_t most) {
  if (of.size() <= most) return of;
  std::vector<KeyframeMap::Id> taken{of.front()};
  std::vector<double> nearest(of.size(), 1e300);
  while (taken.size() < most) {
    std::size_t farthest = 0;
    for (std::size_t i = 0; i < of.size(); ++i) {
      nearest[i] =
          std::min(nearest[i], (map.pose(of[i]).translation() - map.pose(taken.back()).translation()).norm());
      if (nearest[i] > nearest[farthest]) farthest = i;
    }
    taken.push_back(of[farthest]);
  }
  return taken;
}

}  // namespace

MapAlignmentOptions MapAlignmentOptions::read(const options::Section& section) {
  MapAlignmentOptions o;
  o.search.min_score = 0.4;
  o.search.most = 6;
  section.read("use", o.use);
  section.read("least_agree_m", o.least_agree_m, options::kPositive);
  section.read("most_contradict", o.most_contradict, {0.0, 1.0});
  section.read("refused", o.refused, {0.0, 1.0});
  section.read("least_spread", o.least_spread, {0.0, 0.5});
  section.read("rival", o.rival, {0.0, 1.0});
  section.read("least_matched", o.least_matched, {1, 1000});
  section.read("min_matched", o.min_matched, {0.0, 1.0});
  section.read("most_scans", o.most_scans, {1, 1000});
  section.read("most_candidates", o.most_candidates, {1, 100});
  o.overlap = scan::OverlapOptions::read(section.child("overlap"));
  section.finish();
  return o;
}

void MapAlignment::suggest(const Pose2& map_from_own) {
  suggested_.push_back(map_from_own);
}

bool MapAlignment::isSame(const Pose2& a, const Pose2& b) const {
  return (a * middle_m_ - b * middle_m_).norm() < kSame_m &&
         std::abs(wrapAngle(a.theta_rad - b.theta_rad)) < kSame_rad;
}

void MapAlignment::consider(const Pose2& map_from_own) {
  const auto known = [&](const Candidate& c) { return isSame(c.map_from_own, map_from_own); };
  if (std::any_of(candidates_.begin(), candidates_.end(), known)) return;
  candidates_.emplace_back();
  candidates_.back().map_from_own = map_from_own;
}

void MapAlignment::searchNewest(const KeyframeMap& map, const KeyframeMap& own) {
  if (map.size() != searched_ || map.revision() != searched_revision_) {
    std::vector<scan::Reference> references;
    for (const KeyframeMap::Id k : map.all()) references.push_back(map.reference(k));
    search_.setReferences(references);
    searched_ = map.size();
    searched_revision_ = map.revision();
  }
  const auto newest = static_cast<KeyframeMap::Id>(own.size() - 1);
  const scan::Reference scan = own.reference(newest);
  const Pose2 start = map.pose(0);
  for (const scan::PlaceCandidate& found : search_.search(*scan.scan, start, kEverywhere_m, M_PI))
    consider(found.map_from_scan * scan.map_from_scan.inverse());
}

/// Moves a relation to where most keyframes of the robot match the scans around them.
void MapAlignment::refine(const KeyframeMap& map, const KeyframeMap& own, Candidate& candidate) {
  const std::vector<KeyframeMap::Id> ids =
      spread(own, own.all(), static_cast<std::size_t>(options_.most_scans));
  const std::vector<KeyframeMap::Id> all = map.all();
  const Pose2 own_from_middle{middle_m_.x(), middle_m_.y(), 0.0};
  const int rounds = candidate.matched > 0 ? 1 : kRefinements;
  for (int round = 0; round < rounds; ++round) {
    const Pose2 map_from_middle = candidate.map_from_own * own_from_middle;
    std::vector<Eigen::Vector3d> offs;
    for (const KeyframeMap::Id k : ids) {
      const scan::Reference scan = own.reference(k);
      const Pose2 predicted = candidate.map_from_own * scan.map_from_scan;
      std::vector<scan::Reference> references;
      for (const KeyframeMap::Id r : map.nearest({candidate.map_from_own * own.pose(k), scan.scan->sectors()},
                                                 all, static_cast<int>(kNearest)))
        references.push_back(map.reference(r));
      if (references.empty()) continue;
      const scan::Match match = matcher_.match(*scan.scan, predicted, kLoose, references);
      if (!match.valid || match.matched < options_.min_matched || match.chi2 > kMaxChi2) continue;
      const Pose2 says = match.map_from_scan * scan.map_from_scan.inverse() * own_from_middle;
      offs.push_back((map_from_middle.inverse() * says).vector());
    }
    candidate.matched = 0;
    if (offs.empty()) return;
    Eigen::Vector3d middle;
    for (Eigen::Index i = 0; i < 3; ++i) {
      std::vector<double> values;
      for (const Eigen::Vector3d& off : offs) values.push_back(off(i));
      middle(i) = median(values);
    }
    Eigen::Vector3d sum = Eigen::Vector3d::Zero(), squares = Eigen::Vector3d::Zero();
    for (const Eigen::Vector3d& off : offs) {
      if ((off - middle).head<2>().norm() > kInlier_m || std::abs(off(2) - middle(2)) > kInlier_rad) continue;
      sum += off;
      squares += (off - middle).cwiseAbs2();
      ++candidate.matched;
    }
    if (candidate.matched == 0) return;
    sum /= candidate.matched;
    candidate.spread_m = std::sqrt(0.5 * squares.head<2>().sum() / candidate.matched);
    candidate.spread_rad = std::sqrt(squares(2) / candidate.matched);
    candidate.map_from_own = map_from_middle * Pose2::fromVector(sum) * own_from_middle.inverse();
  }
}

void MapAlignment::judge(const KeyframeMap& map, const KeyframeMap& own, Candidate& candidate) const {
  const auto most = static_cast<std::size_t>(options_.most_scans);
  const std::vector<KeyframeMap::Id> all = map.all();
  std::vector<KeyframeMap::Id> near_own, near_map;
  std::vector<bool> used(map.size(), false);
  for (const KeyframeMap::Id k : own.all()) {
    const auto nearest = map.nearest({candidate.map_from_own * own.pose(k)}, all, 1);
    if (!nearest.empty()) near_own.push_back(k);
    for (const KeyframeMap::Id r : map.nearest({candidate.map_from_own * own.pose(k)}, all)) used[r] = true;
  }
  for (const KeyframeMap::Id r : all)
    if (used[r]) near_map.push_back(r);
  std::vector<scan::Reference> a, b;
  for (const KeyframeMap::Id k : spread(own, near_own, most)) {
    a.push_back(own.reference(k));
    a.back().map_from_scan = candidate.map_from_own * a.back().map_from_scan;
  }
  for (const KeyframeMap::Id r : spread(map, near_map, most)) b.push_back(map.reference(r));
  candidate.overlap = scan::overlapOf(a, b, options_.overlap);
}

const MapAlignment::Result& MapAlignment::update(const KeyframeMap& map, const KeyframeMap& own) {
  const bool changed = own.size() != own_seen_ || map.size() != map_seen_ || !suggested_.empty();
  if (!options_.use || map.size() == 0 || own.size() == 0 || !changed) return result_;
  middle_m_ = middleOf(own);
  if (own.size() != own_seen_) searchNewest(map, own);
  for (const Pose2& relation : std::exchange(suggested_, {})) consider(relation);
  own_seen_ = own.size();
  map_seen_ = map.size();
  for (Candidate& candidate : candidates_) {
    refine(map, own, candidate);
    judge(map, own, candidate);
  }
  std::stable_sort(candidates_.begin(), candidates_.end(),
                   [](const Candidate& a, const Candidate& b) { return a.value() > b.value(); });
  // Candidates that refinement has led to one relation are one.
  std::vector<Candidate> distinct;
  for (const Candidate& candidate : candidates_) {
    const auto same = [&](const Candidate& c) { return isSame(c.map_from_own, candidate.map_from_own); };
    if (std::none_of(distinct.begin(), distinct.end(), same)) distinct.push_back(candidate);
  }
  if (distinct.size() > static_cast<std::size_t>(options_.most_candidates))
    distinct.resize(static_cast<std::size_t>(options_.most_candidates));
  candidates_ = std::move(distinct);
  decide();
  return result_;
}

void MapAlignment::decide() {
  result_ = {};
  result_.reason = "no place of its map resembles one of the common map";
  if (candidates_.empty()) return;
  const Candidate& best = candidates_.front();
  const double contradiction = best.overlap.contradiction();
  result_.score = best.overlap.distinct_agree_m > 0 ? 1.0 - contradiction : 0.0;
  result_.map_from_own = best.map_from_own;
  result_.middle_m = middle_m_;
  result_.reason = fmt::format("{:.1f} m of distinct surfaces agree with the common map, {:.1f} m contradict",
                               best.overlap.distinct_agree_m, best.overlap.distinct_contradict_m);
  if (best.overlap.distinct_agree_m < options_.least_agree_m || best.matched < options_.least_matched) {
    result_.reason += "; more must agree";
    return;
  }
  if (contradiction > options_.most_contradict) {
    if (contradiction > options_.refused) result_.status = AlignmentStatus::kRefused;
    return;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> normals(best.overlap.normals);
  if (normals.eigenvalues()(0) < options_.least_spread) {
    result_.reason += "; nearly all are parallel";
    return;
  }
  for (std::size_t i = 1; i < candidates_.size(); ++i) {
    const Candidate& other = candidates_[i];
    if (other.overlap.contradiction() < options_.refused &&
        other.overlap.distinct_agree_m > options_.rival * best.overlap.distinct_agree_m) {
      result_.reason += "; another relation fits as well";
      return;
    }
  }
  const double n = std::max(1.0, static_cast<double>(best.matched));
  const double m = best.spread_m / std::sqrt(n) + 0.005, rad = best.spread_rad / std::sqrt(n) + 0.003;
  result_.covariance = Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
  result_.status = AlignmentStatus::kMatched;
}

}  // namespace omnifleet::estimation
