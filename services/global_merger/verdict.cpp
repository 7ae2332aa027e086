#include "global_merger/verdict.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::global_merger {
namespace {

constexpr int kManyTimes = 4;
constexpr int kRarely = 10;  // views

/// Evidence of the floor, seen at the place of a candidate, against it.
enum class Floor : std::uint8_t {
  kNothing,      ///< the floor was hardly seen there
  kConflicting,  ///< much, but the candidate is surely upright, and rays ended at its place repeatedly
  kAbsent,       ///< the object is gone or was never there
};

/// Shape and place are certain.
bool isCertain(const Evidence& e) {
  constexpr double kSpread = 1.0, kSigma_m = 0.01;
  return e.has_shape && e.views >= kRarely && e.spread <= kSpread && e.sigma_m <= kSigma_m;
}

/// Very few views, or few views and an inaccurate centre.
bool isUncertain(const Evidence& e, const MergerOptions& options) {
  constexpr double kSharp_m = 0.005;
  return e.views < options.gone_after || (e.views < kRarely && e.sigma_m > kSharp_m);
}

/// One upright body explains many views within their noise, and its height is well known. Neither the floor
/// nor a shadow or marking on it moves in the image like that.
bool isUpright(const Evidence& e) {
  constexpr int kViews = 8;
  constexpr double kRms_m = 0.01, kLeast_m = 0.1, kSigma_m = 0.005;
  return e.has_shape && e.views >= kViews && e.rms_m > 0.0 && e.rms_m <= kRms_m && e.height_m >= kLeast_m &&
         e.height_sigma_m > 0.0 && e.height_sigma_m <= kSigma_m;
}

/// The floor was seen at its place later, more often in a row than the object was missed while it was there.
/// An object of about the floor's colour is missed now and then, and from far away.
bool isGone(const Evidence& e, const MergerOptions& options) {
  constexpr double kClearMissShare = 0.1;  // share of misses for an object that is clearly visible
  const double missed = (e.floor_before + 1.0) / (e.floor_before + e.views + 2.0);
  return e.floor_after >= options.gone_after * std::max(1.0, std::log(kClearMissShare) / std::log(missed));
}

/// Since it was first seen the floor was seen as often, from as near; or from anywhere many times as often;
/// or the candidate is uncertain, and the floor was seen as often, or its place many times as often without
/// it.
bool wasNeverThere(const Evidence& e, const MergerOptions& options) {
  if (isUncertain(e, options) && (e.floor_ever >= e.views || e.missed >= kManyTimes * e.views)) return true;
  if (e.views < options.gone_after) return false;
  return e.floor_before + e.floor_after >= e.views || e.floor_since_first >= kManyTimes * e.views;
}

/// Not part of the overlay as printed in Choi §IV.4. Gone: the floor was seen later, more often than
/// explained by the share of views that missed the object before. Never there: see above. A candidate that
/// one upright body explains well is gone only if the floor was seen afterwards many times as often as rays
/// ended at its place.
Floor floorOf(const Evidence& e, const MergerOptions& options) {
  if (e.is_top_face)  // the floor is always seen at the place of its sides
    return e.floor_after >= kManyTimes * e.views ? Floor::kAbsent : Floor::kConflicting;
  const bool is_gone = isGone(e, options);
  if (options.method == "hull") return is_gone ? Floor::kAbsent : Floor::kNothing;
  if (!is_gone && (isCertain(e) || !wasNeverThere(e, options))) return Floor::kNothing;
  if (!isUpright(e)) return Floor::kAbsent;
  if (!is_gone) return Floor::kConflicting;
  return e.floor_after >= kManyTimes * (1 + e.ended_after) ? Floor::kAbsent : Floor::kConflicting;
}

/// Very rarely seen, and cut in every view.
bool isPiece(const Evidence& e, const MergerOptions& options) {
  return e.cut_views == e.views && e.views < options.min_views;
}

/// Rarely seen, and no upright body explains the views well.
bool isRough(const Evidence& e, const MergerOptions& options) {
  constexpr int kSeldom = 20;
  return e.views < kSeldom && e.rms_m > options.seldom_rms_m;
}

/// Low, and missed as often as it was seen: in plain sight, or with the floor seen at its place from
/// anywhere. Of tiles and stains each view shows another piece; together they look like a low object.
bool isPattern(const Evidence& e) {
  constexpr double kLow_m = 0.1;
  const bool is_low = e.height_sigma_m > 0 && e.height_m < kLow_m;
  return is_low && !isCertain(e) && (e.missed_by_walls >= e.views || e.floor_ever >= e.views);
}

/// Its height, from the parallax of its points, is surely above 8 cm.
bool isTall(const Evidence& e) {
  constexpr double kLeast_m = 0.08, kSigmas = 3.0;
  return e.height_sigma_m > 0 && e.height_m - kSigmas * e.height_sigma_m > kLeast_m;
}

bool isFlat(const Evidence& e, const MergerOptions& options) {
  return e.height_sigma_m > 0 && e.height_m + e.height_sigma_m < options.flat_m;
}

/// Surely no higher than a floor marking, and many views agree on its place: a rug, a sheet.
bool isFloorMarking(const Evidence& e, const MergerOptions& options) {
  return isCertain(e) && isFlat(e, options);
}

/// The views disagree, or disagree slightly and hardly ever show the candidate alone. In the latter case the
/// outline may belong to a neighbour, or to the half of it that differs from the floor.
bool isDisagreeing(const Evidence& e) {
  constexpr double kShare = 0.8, kAgree = 0.7, kDisagree = 1.5;  // share of the views; spreads in σ
  return e.from_camera && e.spread > (e.flawed_views >= kShare * e.views ? kAgree : kDisagree);
}

/// Why it is not one object at one place; kNone if it is.
Reason shapeProblem(const Evidence& e, const MergerOptions& options) {
  if (!e.has_shape || e.spread > options.max_spread) return Reason::kNoShape;
  return e.sigma_m > options.max_sigma_m ? Reason::kUncertainPlace : Reason::kNone;
}

/// Something stands there, but its outline would have to be closed by guessing.
Reason structureReason(const Evidence& e, const MergerOptions& options) {
  constexpr double kMostlyCut = 0.8;  // share of its views; lower objects in clutter up to 0.57
  if (e.alone < options.least_alone) return Reason::kAttached;
  const bool top_unseen = e.from_camera && e.cut_views > kMostlyCut * e.views;
  // Of a sliver, rays that ended at one side are near the other one as well.
  const double seen = e.is_thin ? std::min(e.seen, e.faced) : e.seen;
  if (e.is_thin && e.faced < options.least_seen && isDisagreeing(e)) return Reason::kOpenOutline;
  return top_unseen && seen < options.least_seen ? Reason::kOpenOutline : Reason::kNone;
}

/// Reasons of the whole object's evidence, in the order in which they are checked.
Reason problemOf(const Evidence& e, const MergerOptions& options, Floor floor) {
  if (e.kind == ObjectKind::kUnknown && e.fits_silent_robot) return Reason::kSilentRobot;
  if (const Reason shape = shapeProblem(e, options); shape != Reason::kNone) return shape;
  const bool is_paper = options.method == "hull";
  if (!is_paper && isPiece(e, options)) return Reason::kPiece;
  if (!is_paper && e.always_behind && e.views < kRarely) return Reason::kHidden;
  if (!is_paper && isRough(e, options)) return Reason::kRough;
  if (isFlat(e, options)) return Reason::kFlat;
  if (!is_paper && isPattern(e)) return Reason::kPattern;
  if (floor == Floor::kAbsent || (e.is_top_face && e.was_driven_at)) return Reason::kFloorSeen;
  return Reason::kNone;
}

/// Whether a rejected candidate is worth a look. Not reported are candidates with few views, and candidates
/// contradicted by the floor that are flat, or have no single shape and were rarely seen, or have no single
/// shape and no height and were seen less often than the floor.
Verdict rejected(const Evidence& e, const MergerOptions& options, Reason problem, Floor floor) {
  Verdict verdict{Decision::kRejected, problem, 0, false,
                  e.views >= options.min_views && !e.fits_silent_robot};
  if (floor != Floor::kAbsent) return verdict;
  const bool is_one = shapeProblem(e, options) == Reason::kNone;
  if (isFlat(e, options) || (!is_one && e.views < kRarely)) {
    verdict.to_report = false;
  } else if (is_one || e.floor_before + e.floor_after < e.views) {
    verdict.reason = Reason::kFloorSeen;
  } else {
    verdict.reason = isTall(e) ? Reason::kTopFaceOnly : problem;
    verdict.to_report = verdict.to_report && isTall(e);
  }
  return verdict;
}

}  // namespace

const char* toString(Reason reason) {
  switch (reason) {
    case Reason::kNone:
      return "none";
    case Reason::kFewViews:
      return "few_views";
    case Reason::kUndecidedKind:
      return "undecided_kind";
    case Reason::kSilentRobot:
      return "silent_robot";
    case Reason::kNoShape:
      return "no_shape";
    case Reason::kUncertainPlace:
      return "uncertain_place";
    case Reason::kPiece:
      return "piece";
    case Reason::kRough:
      return "rough";
    case Reason::kFlat:
      return "flat";
    case Reason::kPattern:
      return "pattern";
    case Reason::kFloorSeen:
      return "floor_seen";
    case Reason::kTopFaceOnly:
      return "top_face_only";
    case Reason::kHidden:
      return "hidden";
    case Reason::kAttached:
      return "attached";
    case Reason::kOpenOutline:
      return "open_outline";
    case Reason::kPossibleMirror:
      return "possible_mirror";
  }
  return "none";
}

const char* toString(Quality quality) {
  switch (quality) {
    case Quality::kLowContrast:
      return "low_contrast";
    case Quality::kDisagreeing:
      return "disagreeing";
    case Quality::kThin:
      return "thin";
  }
  return "thin";
}

std::vector<std::string> qualityOf(const Verdict& verdict) {
  std::vector<std::string> codes;
  for (const Quality quality : {Quality::kLowContrast, Quality::kDisagreeing, Quality::kThin})
    if ((verdict.quality & static_cast<std::uint8_t>(quality)) != 0) codes.emplace_back(toString(quality));
  return codes;
}

static Verdict decide(const Evidence& e, const MergerOptions& options, bool is_final) {
  const Floor floor = floorOf(e, options);
  const Reason problem = problemOf(e, options, floor);
  if (problem == Reason::kSilentRobot) return {Decision::kRobot, problem, 0, false, false};
  if (e.is_mirrored) return {Decision::kRejected, Reason::kPossibleMirror, 0, false, false};
  if (problem == Reason::kFlat && isFloorMarking(e, options))
    return {Decision::kFloorMarking, problem, 0, false, e.views >= options.min_views};
  if (problem != Reason::kNone) return rejected(e, options, problem, floor);
  if (!is_final && e.views < options.min_views)
    return {Decision::kUndecided, Reason::kFewViews, 0, false, false};
  if (!is_final && e.kind == ObjectKind::kUnknown)
    return {Decision::kUndecided, Reason::kUndecidedKind, 0, false, false};
  const bool is_paper = options.method == "hull";
  const Reason open = is_paper ? Reason::kNone : structureReason(e, options);
  if (open != Reason::kNone) return {Decision::kStructure, open, 0, false, false};
  // Its views disagree, and floor was seen there as well: its outline would be a guess.
  if (!is_paper && floor == Floor::kConflicting && isDisagreeing(e))
    return {Decision::kRejected, Reason::kNoShape, 0, false, true};
  Verdict verdict{Decision::kObstacle, Reason::kNone, 0, false, false};
  if (floor == Floor::kConflicting) verdict.quality |= static_cast<std::uint8_t>(Quality::kLowContrast);
  if (!is_paper && isDisagreeing(e)) verdict.quality |= static_cast<std::uint8_t>(Quality::kDisagreeing);
  if (e.is_thin) verdict.quality |= static_cast<std::uint8_t>(Quality::kThin);
  return verdict;
}

Verdict verdictOf(const Evidence& e, const MergerOptions& options, bool is_final) {
  Verdict verdict = decide(e, options, is_final);
  verdict.is_flat = isFlat(e, options);
  return verdict;
}

}  // namespace omnifleet::global_merger
