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
constexpr double kNoTurn_rad = 0.5;  // a room that is symmetric looks alike after a larger turn
constexpr std::size_t kNear = 4;     // times the scans that are compared: those from which they are taken
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

/// The keyframes closest to a place, however far they are: a room is seen from its other side.
std::vector<KeyframeMap::Id> closest(const KeyframeMap& map, const Eigen::Vector2d& place, std::size_t most) {
  std::vector<KeyframeMap::Id> ids = map.all();
  std::stable_sort(ids.begin(), ids.end(), [&](KeyframeMap::Id a, KeyframeMap::Id b) {
    return (map.pose(a).translation() - place).norm() < (map.pose(b).translation() - place).norm();
  });
  if (ids.size() > most) ids.resize(most);
  return ids;
}

/// The keyframes of a map that are nearest to those of another one, at most `most`, by number.
std::vector<KeyframeMap::Id> nearestTo(const KeyframeMap& map, const KeyframeMap& other,
                                       const Pose2& map_from_other, std::size_t most) {
  std::vector<KeyframeMap::Id> ids = map.all();
  if (ids.size() <= most) return ids;
  std::vector<double> distances;
  for (const KeyframeMap::Id k : ids) {
    double nearest_m = 1e300;
    for (const KeyframeMap::Id o : other.all())
      nearest_m = std::min(nearest_m,
                           (map.pose(k).translation() - map_from_other * other.pose(o).translation()).norm());
    distances.push_back(nearest_m);
  }
  std::stable_sort(ids.begin(), ids.end(),
                   [&](KeyframeMap::Id a, KeyframeMap::Id b) { return distances[a] < distances[b]; });
  ids.resize(most);
  std::sort(ids.begin(), ids.end());
  return ids;
}

}  // namespace

MapAlignmentOptions MapAlignmentOptions::read(const options::Section& section) {
  MapAlignmentOptions o;
  section.read("use", o.use);
  section.read("least_agree_m", o.least_agree_m, options::kPositive);
  section.read("most_contradict", o.most_contradict, {0.0, 1.0});
  section.read("refused", o.refused, {0.0, 1.0});
  section.read("least_spread", o.least_spread, {0.0, 0.5});
  section.read("least_evidence", o.least_evidence, options::kNotNegative);
  section.read("most_compass", o.most_compass, options::kNotNegative);
  section.read("least_compass", o.least_compass, {-100.0, 0.0});
  section.read("rival", o.rival, {0.0, 1.0});
  section.read("rival_compass", o.rival_compass, options::kNotNegative);
  section.read("least_matched", o.least_matched, {1, 1000});
  section.read("min_matched", o.min_matched, {0.0, 1.0});
  section.read("most_scans", o.most_scans, {1, 1000});
  section.read("most_candidates", o.most_candidates, {1, 100});
  o.surfaces.readFrom(section);
  o.compass = MapCompassOptions::read(section.child("compass"));
  o.search = scan::PlaceSearchOptions::read(section.child("search"), o.search);
  o.overlap = scan::OverlapOptions::read(section.child("overlap"));
  section.finish();
  return o;
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

void MapAlignment::Side::hold(const KeyframeMap& map) {
  if (map.size() == size && map.revision() == revision) return;
  std::vector<scan::Reference> references;
  for (const KeyframeMap::Id k : map.all()) references.push_back(map.reference(k));
  places.setReferences(references);
  transients.update(references);
  size = map.size();
  revision = map.revision();
}

std::vector<Pose2> MapAlignment::Side::find(const scan::Reference& scan, double turn_rad,
                                            double reach_rad) const {
  std::vector<Pose2> relations;
  const Pose2 start{0.0, 0.0, wrapAngle(turn_rad + scan.map_from_scan.theta_rad)};
  for (const scan::PlaceCandidate& found : places.search(*scan.scan, start, kEverywhere_m, reach_rad))
    relations.push_back(found.map_from_scan * scan.map_from_scan.inverse());
  return relations;
}

/// Each new scan of either map is searched in the other one: what one robot sees from a place, the other may
/// have seen from behind. It is also searched in its own map. One older scan is searched again: what it shows
/// may have been added to the other map since.
void MapAlignment::addCandidates(const KeyframeMap& map, const KeyframeMap& own) {
  map_side_.hold(map);
  own_side_.hold(own);
  const auto searchInMap = [&](std::size_t k) {
    for (const Pose2& relation : map_side_.find(own.reference(static_cast<KeyframeMap::Id>(k))))
      consider(relation);
  };
  const auto searchInOwn = [&](std::size_t k) {
    for (const Pose2& relation : own_side_.find(map.reference(static_cast<KeyframeMap::Id>(k))))
      consider(relation.inverse());
  };
  if (map.size() != map_seen_) searchInOwn(map.size() - 1);
  if (own.size() != own_seen_) {
    searchInMap(own.size() - 1);
    const scan::Reference newest = own.reference(static_cast<KeyframeMap::Id>(own.size() - 1));
    for (const Pose2& twin : own_side_.find(newest, M_PI, M_PI - kNoTurn_rad)) {
      const auto known = [&](const Candidate& c) { return isSame(c.map_from_own, twin); };
      if (isSame(twin, {}) || std::any_of(symmetries_.begin(), symmetries_.end(), known)) continue;
      symmetries_.emplace_back();
      symmetries_.back().map_from_own = twin;
    }
  }
  const std::size_t turn = searched_again_++;
  if (turn % 2 == 0)
    searchInMap(turn / 2 % own.size());
  else
    searchInOwn(turn / 2 % map.size());
  map_seen_ = map.size();
  own_seen_ = own.size();
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
      std::vector<KeyframeMap::Id> around = map.nearest(
          {candidate.map_from_own * own.pose(k), scan.scan->sectors()}, all, static_cast<int>(kNearest));
      if (around.empty()) around = closest(map, predicted.translation(), kNearest);
      std::vector<scan::Reference> references;
      for (const KeyframeMap::Id r : around) references.push_back(map.reference(r));
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

void MapAlignment::judge(const MapToAlign& map_places, const Side& map_side, const MapToAlign& own_places,
                         Candidate& candidate) {
  const KeyframeMap &map = map_places.keyframes, &own = own_places.keyframes;
  const auto most = static_cast<std::size_t>(options_.most_scans);
  std::vector<scan::View> a, b;
  for (const KeyframeMap::Id k :
       spread(own, nearestTo(own, map, candidate.map_from_own.inverse(), kNear * most), most)) {
    a.push_back(own_side_.view(own, k));
    a.back().reference.map_from_scan = candidate.map_from_own * a.back().reference.map_from_scan;
  }
  for (const KeyframeMap::Id r : spread(map, nearestTo(map, own, candidate.map_from_own, kNear * most), most))
    b.push_back(map_side.view(map, r));
  candidate.overlap = scan::overlapOf(a, b, options_.overlap);
  candidate.compass = {};
  for (const PlaceMemory* places : own_places.places) {
    const MapCompass::Opinion opinion =
        compass_.ask(map_places.places, *places, candidate.map_from_own, candidate.spread_rad);
    candidate.compass.pairs += opinion.pairs;
    candidate.compass.evidence += opinion.evidence;
  }
  // Below least_compass the images contradict: decide() says so of the relation that the surfaces prefer.
  candidate.evidence = options_.surfaces.of(candidate.overlap) +
                       std::clamp(candidate.compass.evidence, options_.least_compass, options_.most_compass);
}

constexpr auto isBetter = [](const auto& a, const auto& b) { return a.evidence > b.evidence; };

/// Relations of the robot's map to itself that its surfaces do not contradict, and at which some of its scans
/// match: shifts that move the map nearly off itself are no symmetries. Each gives each candidate a twin.
void MapAlignment::updateSymmetries(const MapToAlign& own) {
  for (Candidate& symmetry : symmetries_) {
    refine(own.keyframes, own.keyframes, symmetry);
    judge(own, own_side_, own, symmetry);
  }
  const auto ends = [&](const Candidate& c) {
    return isSame(c.map_from_own, {}) || c.matched == 0 || !isPossible(c) || isDistinguished({}, c.compass);
  };
  symmetries_.erase(std::remove_if(symmetries_.begin(), symmetries_.end(), ends), symmetries_.end());
  std::stable_sort(symmetries_.begin(), symmetries_.end(), isBetter);
  if (symmetries_.size() > static_cast<std::size_t>(options_.most_candidates))
    symmetries_.resize(static_cast<std::size_t>(options_.most_candidates));
}

bool MapAlignment::isPossible(const Candidate& candidate) const {
  return candidate.overlap.contradiction() < options_.refused &&
         options_.surfaces.of(candidate.overlap) >= 0.0;
}

/// Whether the images prefer one relation, at as many pairs of places as both have.
bool MapAlignment::isDistinguished(const MapCompass::Opinion& best, const MapCompass::Opinion& other) const {
  if (other.pairs == 0) return false;
  const double share = best.pairs > other.pairs ? static_cast<double>(other.pairs) / best.pairs : 1.0;
  return share * best.evidence - other.evidence >= options_.rival_compass;
}

/// Whether another relation explains as much. That of a symmetric map does even where the others have seen
/// less of what it would need, unless that contradicts it.
bool MapAlignment::isRival(const Candidate& best, const Candidate& other) const {
  if (!isPossible(other) || isDistinguished(best.compass, other.compass)) return false;
  if (other.overlap.distinct_agree_m > options_.rival * best.overlap.distinct_agree_m) return true;
  const Pose2 between = best.map_from_own.inverse() * other.map_from_own;
  return std::any_of(symmetries_.begin(), symmetries_.end(), [&](const Candidate& s) {
    return isSame(s.map_from_own, between) || isSame(s.map_from_own, between.inverse());
  });
}

const MapAlignment::Result& MapAlignment::update(const MapToAlign& map, const MapToAlign& own) {
  const KeyframeMap &theirs = map.keyframes, &mine = own.keyframes;
  const bool changed = mine.size() != own_seen_ || theirs.size() != map_seen_;
  if (!options_.use || theirs.size() == 0 || mine.size() == 0 || !changed) return result_;
  middle_m_ = middleOf(mine);
  const bool grown = mine.size() != own_seen_;
  addCandidates(theirs, mine);
  if (grown) updateSymmetries(own);
  std::size_t judged = 0;
  const auto judgeNew = [&] {
    for (; judged < candidates_.size(); ++judged) {
      refine(theirs, mine, candidates_[judged]);
      judge(map, map_side_, own, candidates_[judged]);
    }
    std::stable_sort(candidates_.begin(), candidates_.end(), isBetter);
  };
  judgeNew();
  if (!candidates_.empty()) {
    const Pose2 best = candidates_.front().map_from_own;
    for (const Candidate& symmetry : symmetries_) consider(best * symmetry.map_from_own);
    judgeNew();
  }
  // Candidates that refinement has led to one relation are one.
  std::vector<Candidate> distinct;
  for (const Candidate& candidate : candidates_) {
    const auto same = [&](const Candidate& c) { return isSame(c.map_from_own, candidate.map_from_own); };
    if (std::none_of(distinct.begin(), distinct.end(), same)) distinct.push_back(candidate);
  }
  candidates_ = std::move(distinct);
  decide();
  if (candidates_.size() > static_cast<std::size_t>(options_.most_candidates))
    candidates_.resize(static_cast<std::size_t>(options_.most_candidates));
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
  if (best.overlap.distinct_agree_m < options_.least_agree_m) {
    result_.reason += "; more must agree";
    return;
  }
  if (contradiction > options_.most_contradict) {
    if (contradiction > options_.refused) result_.status = AlignmentStatus::kRefused;
    return;
  }
  if (best.compass.evidence < options_.least_compass) {
    result_.reason += "; the images contradict the heading";
    return;
  }
  if (best.matched < options_.least_matched || best.evidence < options_.least_evidence) {
    result_.reason += "; more must agree";
    return;
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> normals(best.overlap.normals);
  if (normals.eigenvalues()(0) < options_.least_spread) {
    result_.reason += "; nearly all are parallel";
    return;
  }
  for (std::size_t i = 1; i < candidates_.size(); ++i) {
    if (!isRival(best, candidates_[i])) continue;
    result_.reason += "; another relation fits as well";
    return;
  }
  const double n = std::max(1.0, static_cast<double>(best.matched));
  const double m = best.spread_m / std::sqrt(n) + 0.005, rad = best.spread_rad / std::sqrt(n) + 0.003;
  result_.covariance = Eigen::Vector3d(m * m, m * m, rad * rad).asDiagonal();
  result_.status = AlignmentStatus::kMatched;
}

}  // namespace omnifleet::estimation
