#pragma once

#include <Eigen/Core>
#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "appearance/compass.h"
#include "estimation/keyframe_map.h"
#include "estimation/surface_evidence.h"
#include "geometry/pose2.h"
#include "observation/appearance.h"
#include "options/options.h"
#include "scan/map_overlap.h"
#include "scan/place_search.h"
#include "scan/scan_matcher.h"

namespace omnifleet::estimation {

struct LoopCheckOptions {
  double reach_m = 2.0;           ///< m, largest distance of two places that are compared
  double min_matched = 0.4;       ///< 1, share of a scan's lines that must meet lines of the other one
  double max_chi2 = 6.0;          ///< 1, mean squared residual of these, in σ²
  double most_sigma_m = 0.05;     ///< m, σ of the relative position in any direction, at most
  double most_contradict = 0.22;  ///< 1, share of the common surfaces that may contradict
  double refused = 0.35;          ///< 1, share from which another relation is no rival
  double rival_evidence = 1.0;    ///< nats, by which the best relation must exceed every other one
  double least_evidence = 1.5;    ///< nats, for the best relation: 300 pairs of wrong places reached 1.08
  SurfaceEvidence surfaces;
  // Evidence of the compass: density of its answer at the scan's heading, relative to an even one.
  double most_compass = 2.0;  ///< nats, at most: the compass distinguishes headings; rooms with equal walls
                              ///< may look alike, too
  double most_confidence = 0.98;   ///< 1, of an answer of the compass; no answer counts as more certain
  double least_compass = -3.0;     ///< nats, below which the compass contradicts, whatever the scans say
  double narrow_confidence = 0.9;  ///< 1, from which the compass bounds the headings that are searched …
  double narrow_rad = 0.35;        ///< rad, … to so much about its answer, plus 3 σ
  scan::PlaceSearchOptions search;
  scan::OverlapOptions overlap;
  appearance::CompassOptions compass;
  /// The search looks for more candidates than relocalization: the evidence decides.
  LoopCheckOptions() {
    search.min_score = 0.3;
    search.margin = 0.3;
  }
  static LoopCheckOptions read(const options::Section& section);
};

/// A place as it is compared: its scan, the scans around and, if there is one, its signature. Kept by
/// reference.
struct LoopPlace {
  const scan::LineScan* scan = nullptr;  ///< null: only those around
  Pose2 base_from_scan;
  /// Further scans of the same robot around the place; map_from_scan is relative to base_link at the place.
  /// They show what the single scan does not: rooms that look alike from one corner differ elsewhere.
  std::vector<scan::Reference> around;
  const SignatureFormat* format = nullptr;
  const StoredSignature* signature = nullptr;  ///< null: none
};

/// Decides whether two places are near each other in one room, and how they lie, without any initial guess.
/// The scan of one is searched among those of the other (scan::PlaceSearch) and matched. Each relation found
/// is judged by what the scans of both should show (scan::overlapOf), by the visual compass, and by its
/// rivals. So a room with equal walls and other furniture is refused, and a symmetric room stays open unless
/// the compass distinguishes the directions. (Fernández et al. 2011 §VI name loop closing as future work;
/// this project.)
class LoopCheck {
 public:
  explicit LoopCheck(const LoopCheckOptions& options = {}, const scan::MatchOptions& match = {},
                     const KeyframeOptions& keyframes = {})
      : options_(options),
        keyframes_(keyframes),
        matcher_(match),
        search_(options.search),
        compass_(options.compass) {}

  /// What the compass says about a heading of the scans.
  struct CompassOpinion {
    bool valid = false;       ///< false: no signatures, other formats, or no answer
    double turn_rad = 0.0;    ///< heading of the second place minus that of the first one
    double sigma_rad = 0.0;   ///< of turn_rad, if it is right at all
    double confidence = 0.0;  ///< probability that it is
    double evidence = 0.0;    ///< nats, logarithm of the ratio: > 0 for, < 0 against the scans' heading
  };

  struct Result {
    bool closed = false;
    Pose2 from_to;  ///< of the best relation, from_base ← to_base; valid if candidates > 0
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of it, right perturbation
    double score = 0.0;     ///< 0 … 1: probability of the relation, if it is as likely as not before
    double evidence = 0.0;  ///< nats, of surfaces and compass
    std::string reason;     ///< in words
    int candidates = 0;     ///< relations at which the scans match
    double matched = 0.0;   ///< share of the lines
    double chi2 = 0.0;      ///< mean squared residual of these, in σ²
    scan::Overlap overlap;
    CompassOpinion compass;            ///< at the best relation
    double lead = 0.0;                 ///< nats, over the best other relation; without any: the evidence
    std::optional<double> difference;  ///< of the signatures, each divided by its norm; none: incomparable
  };

  /// Searches the relation of two places and decides.
  Result check(const LoopPlace& from, const LoopPlace& to);

  /// Whether the surfaces speak rather against a relation that something else has found than for it, or the
  /// compass against its heading. The places need no scan of their own, only scans around.
  /// @param sigma_rad of the heading
  bool contradicts(const LoopPlace& from, const LoopPlace& to, const Pose2& from_to, double sigma_rad);

 private:
  struct Relation {
    Pose2 from_to;  ///< of base_link
    scan::Match match;
    scan::Overlap overlap;
    CompassOpinion compass;
    double evidence = 0.0;
  };
  struct Views {
    appearance::Compass::View from, to;
  };
  /// Headings of `to` in `from` that are searched.
  struct Headings {
    double middle_rad = 0.0, reach_rad = M_PI;
  };
  std::optional<Views> viewsOf(const LoopPlace& from, const LoopPlace& to, Result& result) const;
  CompassOpinion ask(const Views& views, const Pose2& from_to, double sigma_rad);
  Headings headingsOf(const std::optional<Views>& views);
  /// All scans of a place, its own first; map_from_scan is relative to base_link at the place.
  static std::vector<scan::Reference> scansOf(const LoopPlace& place);
  void addRelations(const LoopPlace& from, const LoopPlace& to, const std::optional<Views>& views,
                    const Headings& headings, bool reversed, std::vector<Relation>& found);
  std::string whyOpen(const Result& result) const;

  LoopCheckOptions options_;
  KeyframeOptions keyframes_;
  scan::ScanMatcher matcher_;
  scan::PlaceSearch search_;
  appearance::Compass compass_;
};

}  // namespace omnifleet::estimation
