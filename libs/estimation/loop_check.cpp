#include "estimation/loop_check.h"

#include <fmt/format.h>

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>

#include "appearance/signature.h"
#include "appearance/stored_signature.h"
#include "estimation/compass_evidence.h"

namespace omnifleet::estimation {
namespace {

constexpr double kSame_m = 0.15, kSame_rad = 0.1;  // relations that are one
constexpr double kHeadingSigmas = 3.0;             // of the compass
constexpr double kOpen_m = 10.0;                   // σ of a direction that a match leaves open
constexpr double kDegrees = 180.0 / M_PI;
// Of the candidate that a match starts from: 10 cm, 3°.
const Eigen::Matrix3d kAboutCandidate = Eigen::Vector3d(100.0, 100.0, 400.0).asDiagonal();

bool isSame(const Pose2& a, const Pose2& b) {
  const Pose2 by = a.inverse() * b;
  return by.translation().norm() < kSame_m && std::abs(by.theta_rad) < kSame_rad;
}

/// Of the match, without the prior; directions that the scans leave open have a large variance.
Eigen::Matrix3d covarianceOf(const scan::Match& match) {
  Eigen::Matrix3d information = match.information;
  information.diagonal().array() += 1.0 / (kOpen_m * kOpen_m);
  return information.inverse();
}

double largestSigma(const Eigen::Matrix3d& covariance) {
  const Eigen::Matrix2d place = covariance.topLeftCorner<2, 2>();
  return std::sqrt(place.selfadjointView<Eigen::Lower>().eigenvalues().maxCoeff());
}

}  // namespace

LoopCheckOptions LoopCheckOptions::read(const options::Section& section) {
  using options::kPositive;
  LoopCheckOptions o;
  section.read("reach_m", o.reach_m, kPositive);
  section.read("min_matched", o.min_matched, {0.0, 1.0});
  section.read("max_chi2", o.max_chi2, kPositive);
  section.read("most_sigma_m", o.most_sigma_m, kPositive);
  section.read("most_contradict", o.most_contradict, {0.0, 1.0});
  section.read("refused", o.refused, {0.0, 1.0});
  section.read("rival_evidence", o.rival_evidence, options::kNotNegative);
  section.read("least_evidence", o.least_evidence, options::kNotNegative);
  o.surfaces.readFrom(section);
  section.read("most_compass", o.most_compass, options::kNotNegative);
  section.read("most_confidence", o.most_confidence, {0.0, 1.0 - 1e-6});
  section.read("least_compass", o.least_compass, {-100.0, 0.0});
  section.read("narrow_confidence", o.narrow_confidence, {0.0, 1.0});
  section.read("narrow_rad", o.narrow_rad, kPositive);
  o.search = scan::PlaceSearchOptions::read(section.child("search"), o.search);
  o.overlap = scan::OverlapOptions::read(section.child("overlap"));
  o.compass = appearance::CompassOptions::read(section.child("compass"));
  section.finish();
  return o;
}

/// Both signatures for the compass; the reason is set if they cannot be compared.
std::optional<LoopCheck::Views> LoopCheck::viewsOf(const LoopPlace& from, const LoopPlace& to,
                                                   Result& result) const {
  if (from.signature == nullptr || to.signature == nullptr) return std::nullopt;
  if (const std::string why = appearance::whyIncomparable(*from.format, *to.format); !why.empty()) {
    result.reason = "the signatures are not comparable: " + why;
    return std::nullopt;
  }
  for (const LoopPlace* place : {&from, &to}) {
    if (const std::string why = appearance::whyMalformed(*place->format, *place->signature); !why.empty()) {
      result.reason = why;
      return std::nullopt;
    }
  }
  const appearance::Signature a = appearance::restore(*from.format, *from.signature),
                              b = appearance::restore(*to.format, *to.signature);
  result.difference = appearance::shapeDifference(a, b);
  return Views{compass_.prepare(a), compass_.prepare(b)};
}

LoopCheck::CompassOpinion LoopCheck::ask(const Views& views, const Pose2& from_to, double sigma_rad) {
  const appearance::CompassResult found = compass_.compare(views.from, views.to, hintOf(from_to));
  return {found.valid, found.turn_rad, found.sigma_rad, found.confidence,
          compassEvidence(found, from_to.theta_rad, sigma_rad, options_.most_confidence)};
}

LoopCheck::Headings LoopCheck::headingsOf(const std::optional<Views>& views) {
  if (!views) return {};
  const appearance::CompassResult turn = compass_.compare(views->from, views->to);
  if (!turn.valid || turn.confidence < options_.narrow_confidence) return {};
  return {turn.turn_rad, std::min(M_PI, options_.narrow_rad + kHeadingSigmas * turn.sigma_rad)};
}

std::vector<scan::Reference> LoopCheck::scansOf(const LoopPlace& place) {
  std::vector<scan::Reference> scans;
  if (place.scan != nullptr) scans.push_back({place.scan, place.base_from_scan});
  scans.insert(scans.end(), place.around.begin(), place.around.end());
  return scans;
}

/// Adds the relations at which the scans match, found by a search of one place's own scan among those of the
/// other.
/// @param reversed the scan of `from` is searched among those of `to`
void LoopCheck::addRelations(const LoopPlace& from, const LoopPlace& to, const std::optional<Views>& views,
                             const Headings& headings, bool reversed, std::vector<Relation>& found) {
  const std::vector<scan::Reference> of_from = scansOf(from), of_to = scansOf(to);
  const LoopPlace& searched = reversed ? from : to;
  search_.setReferences(reversed ? of_to : of_from);
  const Pose2 start{0.0, 0.0, reversed ? -headings.middle_rad : headings.middle_rad};
  for (const scan::PlaceCandidate& candidate : search_.search(*searched.scan, start * searched.base_from_scan,
                                                              options_.reach_m, headings.reach_rad)) {
    const Pose2 other_from_searched = candidate.map_from_scan * searched.base_from_scan.inverse();
    Relation relation;
    relation.from_to = reversed ? other_from_searched.inverse() : other_from_searched;
    relation.match = matcher_.match(*to.scan, relation.from_to * to.base_from_scan, kAboutCandidate, of_from);
    if (!relation.match.valid) continue;
    // The prior was a guess of the search; the second match starts from the optimum.
    relation.match = matcher_.match(*to.scan, relation.match.map_from_scan, kAboutCandidate, of_from);
    if (!relation.match.valid || relation.match.chi2 > options_.max_chi2) continue;
    relation.from_to = relation.match.map_from_scan * to.base_from_scan.inverse();
    const auto known = [&](const Relation& other) { return isSame(relation.from_to, other.from_to); };
    if (std::any_of(found.begin(), found.end(), known)) continue;
    std::vector<scan::Reference> there = of_to;
    for (scan::Reference& scan : there) scan.map_from_scan = relation.from_to * scan.map_from_scan;
    relation.overlap = scan::overlapOf(of_from, there, options_.overlap);
    if (views)
      relation.compass = ask(*views, relation.from_to, std::sqrt(covarianceOf(relation.match)(2, 2)));
    relation.evidence =
        options_.surfaces.of(relation.overlap) + std::min(options_.most_compass, relation.compass.evidence);
    found.push_back(std::move(relation));
  }
  std::stable_sort(found.begin(), found.end(),
                   [](const Relation& a, const Relation& b) { return a.evidence > b.evidence; });
}

bool LoopCheck::contradicts(const LoopPlace& from, const LoopPlace& to, const Pose2& from_to,
                            double sigma_rad) {
  std::vector<scan::Reference> there = scansOf(to);
  for (scan::Reference& scan : there) scan.map_from_scan = from_to * scan.map_from_scan;
  Result incomparable;
  const std::optional<Views> views = viewsOf(from, to, incomparable);
  const CompassOpinion compass = views ? ask(*views, from_to, sigma_rad) : CompassOpinion{};
  // Surfaces distinguish rooms, the compass distinguishes headings: neither makes up for the other.
  return compass.evidence < options_.least_compass ||
         options_.surfaces.of(scan::overlapOf(scansOf(from), there, options_.overlap)) < 0.0;
}

/// Empty if the places close a loop.
std::string LoopCheck::whyOpen(const Result& r) const {
  if (r.overlap.contradiction() > options_.most_contradict)
    return fmt::format("{:.0f} % of the common surfaces contradict", 100.0 * r.overlap.contradiction());
  if (r.matched < options_.min_matched)
    return fmt::format("only {:.0f} % of the lines match", 100.0 * r.matched);
  if (const double sigma_m = largestSigma(r.covariance); sigma_m > options_.most_sigma_m)
    return fmt::format("the scans leave a direction open (sigma {:.2f} m)", sigma_m);
  if (r.compass.evidence < options_.least_compass)
    return fmt::format("the compass contradicts: {:.1f} deg, the scans {:.1f} deg",
                       r.compass.turn_rad * kDegrees, r.from_to.theta_rad * kDegrees);
  if (r.evidence < options_.least_evidence)
    return fmt::format("too little evidence: {:.1f} m of distinct surfaces agree, {:.1f} m contradict",
                       r.overlap.distinct_agree_m, r.overlap.distinct_contradict_m);
  if (r.lead < options_.rival_evidence) return "another relation fits as well";
  return "";
}

LoopCheck::Result LoopCheck::check(const LoopPlace& from, const LoopPlace& to) {
  Result result;
  const std::optional<Views> views = viewsOf(from, to, result);
  const Headings headings = headingsOf(views);
  std::vector<Relation> found;
  addRelations(from, to, views, headings, false, found);
  // Each scan sees something that is hidden from the other one, and a search counts its own beams.
  if (found.empty() || found.front().evidence < options_.least_evidence)
    addRelations(from, to, views, headings, true, found);
  result.candidates = static_cast<int>(found.size());
  if (found.empty()) {
    result.reason += (result.reason.empty() ? "" : "; ") + std::string("the scans match nowhere");
    if (headings.reach_rad < M_PI)
      result.reason +=
          fmt::format(" near the heading of the compass, {:.1f} deg", headings.middle_rad * kDegrees);
    return result;
  }
  const Relation& best = found.front();
  const Pose2 scan_from_base = to.base_from_scan.inverse();
  result.from_to = best.from_to;
  result.matched = best.match.matched;
  result.chi2 = best.match.chi2;
  result.overlap = best.overlap;
  result.compass = best.compass;
  result.evidence = result.lead = best.evidence;
  result.score = 1.0 / (1.0 + std::exp(-best.evidence));
  const Eigen::Matrix3d of_scan =
      covarianceOf(best.match) +
      systematicCovariance(*from.scan, best.from_to.translation().norm(), keyframes_);
  result.covariance = composeCovariance(of_scan, scan_from_base, Eigen::Matrix3d::Zero());
  for (std::size_t i = 1; i < found.size(); ++i) {
    if (found[i].overlap.contradiction() >= options_.refused) continue;
    result.lead = std::min(result.lead, best.evidence - found[i].evidence);
  }
  const std::string why = whyOpen(result);
  result.closed = why.empty();
  const std::string verdict =
      result.closed ? fmt::format("{:.1f} m of distinct surfaces agree, {:.1f} m contradict",
                                  best.overlap.distinct_agree_m, best.overlap.distinct_contradict_m)
                    : why;
  result.reason += (result.reason.empty() ? "" : "; ") + verdict;
  return result;
}

}  // namespace omnifleet::estimation
