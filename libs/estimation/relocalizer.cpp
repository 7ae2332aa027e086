#include "estimation/relocalizer.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

namespace omnifleet::estimation {
namespace {

constexpr double kSame_m = 0.15, kSame_rad = 0.1;  // places that are one
constexpr int kMostMissed = 2;                     // frames in a row that end a hypothesis
constexpr double kMaxChi2 = 6.0;
constexpr double kOpen_m = 0.1;       // σ of a match beyond which it confirms no place
constexpr double kPerRadian_m = 0.5;  // of travel that a turn counts as

bool same(const Pose2& a, const Pose2& b) {
  const Pose2 by = a.inverse() * b;
  return by.translation().norm() < kSame_m && std::abs(by.theta_rad) < kSame_rad;
}

}  // namespace

RelocalizerOptions RelocalizerOptions::read(const options::Section& section) {
  using options::kPositive;
  RelocalizerOptions o;
  section.read("min_score", o.min_score, {0.0, 1.0});
  section.read("min_matched", o.min_matched, {0.0, 1.0});
  section.read("rival", o.rival, {0.0, 1.0});
  section.read("look_every_m", o.look_every_m, kPositive);
  section.read("look_share", o.look_share, {0.0, 10.0});
  section.read("confirm_m", o.confirm_m, options::kNotNegative);
  section.read("confirm_share", o.confirm_share, {0.0, 10.0});
  section.read("confirm_rad", o.confirm_rad, options::kNotNegative);
  section.read("confirm_frames", o.confirm_frames, {1, 1000});
  o.search = scan::PlaceSearchOptions::read(section.child("search"));
  section.finish();
  return o;
}

void Relocalizer::forget() {
  hypotheses_.clear();
  found_.reset();
  since_look_m_ = std::numeric_limits<double>::infinity();
}

std::optional<Relocalizer::Found> Relocalizer::reject() {
  if (!found_) return std::nullopt;
  hypotheses_.erase(hypotheses_.begin() + static_cast<std::ptrdiff_t>(*found_));
  return decide();
}

std::optional<Relocalizer::Found> Relocalizer::decide() {
  found_ = best();
  if (!found_) return std::nullopt;
  const Hypothesis& h = hypotheses_[*found_];
  return Found{h.map_from_base, h.keyframe, h.keyframe_from_base, h.covariance};
}

std::optional<Relocalizer::Found> Relocalizer::look(const KeyframeMap& map, const ScanAid& aid,
                                                    const Pose2& predicted, const Pose2& motion,
                                                    const std::vector<KeyframeMap::Id>& among, double reach_m,
                                                    double reach_rad, const Suggest& suggest) {
  const double way_m = motion.translation().norm(), turn_rad = std::abs(motion.theta_rad);
  since_look_m_ += way_m + turn_rad * kPerRadian_m;
  found_.reset();
  for (Hypothesis& h : hypotheses_) {
    h.map_from_base = h.map_from_base * motion;
    h.keyframe_from_base = h.keyframe_from_base * motion;
    h.travelled_m += way_m;
    h.turned_rad += turn_rad;
  }
  if (!aid.has_scan || among.empty()) return std::nullopt;
  const auto ended = [&](Hypothesis& h) { return !follow(map, aid, among, h) && h.missed > kMostMissed; };
  hypotheses_.erase(std::remove_if(hypotheses_.begin(), hypotheses_.end(), ended), hypotheses_.end());
  const double extent_m = extentOf(map, among, reach_m);
  if (since_look_m_ >= std::max(options_.look_every_m, options_.look_share * extent_m)) {
    since_look_m_ = 0.0;
    prepareSearch(map, among);
    search(map, aid, among, {predicted, reach_m, reach_rad});
    if (suggest)
      for (const Suggestion& suggestion : suggest()) search(map, aid, among, suggestion);
  }
  confirm_m_ = std::max(options_.confirm_m, options_.confirm_share * extent_m);
  return decide();
}

/// Width of the area that is searched.
double Relocalizer::extentOf(const KeyframeMap& map, const std::vector<KeyframeMap::Id>& among,
                             double reach_m) {
  Eigen::AlignedBox2d extent;
  for (const KeyframeMap::Id k : among) extent.extend(map.pose(k).translation());
  return std::min(2.0 * reach_m, extent.diagonal().norm());
}

/// Matches the scan at a hypothesis. @return whether it agrees
bool Relocalizer::follow(const KeyframeMap& map, const ScanAid& aid,
                         const std::vector<KeyframeMap::Id>& among, Hypothesis& h) {
  const std::vector<KeyframeMap::Id> near = map.nearest({h.map_from_base, aid.scan.sectors()}, among);
  ++h.missed;
  if (near.empty()) return false;
  std::vector<scan::Reference> references;
  for (const KeyframeMap::Id k : near) references.push_back(map.reference(k));
  const Eigen::Matrix3d prior = Eigen::Vector3d(100.0, 100.0, 400.0).asDiagonal();  // 10 cm, 3°
  const scan::Match match = matcher_.match(aid.scan, h.map_from_base * aid.base_from_scan, prior, references);
  if (!match.valid || match.matched < options_.min_matched || match.chi2 > kMaxChi2) return false;
  h.missed = 0;
  const Eigen::Matrix2d place = match.information.topLeftCorner<2, 2>();
  if (place.selfadjointView<Eigen::Lower>().eigenvalues().minCoeff() < 1.0 / (kOpen_m * kOpen_m)) {
    // In a corridor one place is like the next.
    h.map_from_base = match.map_from_scan * aid.base_from_scan.inverse();
    return true;
  }
  ++h.agreed;
  h.matched += (match.matched - h.matched) / h.agreed;
  h.map_from_base = match.map_from_scan * aid.base_from_scan.inverse();
  h.keyframe = near.front();
  h.keyframe_from_base = map.pose(h.keyframe).inverse() * h.map_from_base;
  Eigen::Matrix3d information = match.information;
  information.diagonal().array() += 100.0;
  h.covariance =
      information.inverse() + map.systematic(h.keyframe, h.keyframe_from_base.translation().norm());
  return true;
}

void Relocalizer::prepareSearch(const KeyframeMap& map, const std::vector<KeyframeMap::Id>& among) {
  if (among == searched_ && map.revision() == revision_) return;
  std::vector<scan::Reference> references;
  for (const KeyframeMap::Id k : among) references.push_back(map.reference(k));
  search_.setReferences(references);
  searched_ = among;
  revision_ = map.revision();
}

void Relocalizer::search(const KeyframeMap& map, const ScanAid& aid,
                         const std::vector<KeyframeMap::Id>& among, const Suggestion& about) {
  for (const scan::PlaceCandidate& candidate :
       search_.search(aid.scan, about.map_from_base * aid.base_from_scan, about.reach_m, about.reach_rad)) {
    if (candidate.score < options_.min_score) continue;
    Hypothesis h;
    h.map_from_base = candidate.map_from_scan * aid.base_from_scan.inverse();
    const auto known = [&](const Hypothesis& other) { return same(h.map_from_base, other.map_from_base); };
    if (std::any_of(hypotheses_.begin(), hypotheses_.end(), known)) continue;
    if (!follow(map, aid, among, h) || std::any_of(hypotheses_.begin(), hypotheses_.end(), known)) continue;
    hypotheses_.push_back(h);
  }
}

/// The best hypothesis, if it agreed for long enough and no other place matches nearly as well, as in a
/// symmetric room.
std::optional<std::size_t> Relocalizer::best() const {
  const Hypothesis* best = nullptr;
  for (const Hypothesis& h : hypotheses_)
    if (best == nullptr || h.agreed * h.matched > best->agreed * best->matched) best = &h;
  if (best == nullptr || best->missed > 0 || best->agreed < options_.confirm_frames) return std::nullopt;
  if (best->travelled_m < confirm_m_ &&
      best->turned_rad * options_.confirm_m < options_.confirm_rad * confirm_m_)
    return std::nullopt;
  const bool rivalled = std::any_of(hypotheses_.begin(), hypotheses_.end(), [&](const Hypothesis& h) {
    return &h != best && h.missed == 0 && h.matched > options_.rival * best->matched;
  });
  if (rivalled) return std::nullopt;
  return static_cast<std::size_t>(best - hypotheses_.data());
}

}  // namespace omnifleet::estimation
