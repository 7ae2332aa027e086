#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "estimation/keyframe_map.h"
#include "geometry/pose2.h"
#include "observation/observation.h"
#include "options/options.h"
#include "scan/map_overlap.h"
#include "scan/place_search.h"
#include "scan/scan_matcher.h"

namespace omnifleet::estimation {

struct MapAlignmentOptions {
  bool use = true;               ///< robots without an initial pose are matched with the map of the others
  double least_agree_m = 4.0;    ///< m of distinct surfaces that both maps must show alike
  double most_contradict = 0.2;  ///< 1, share of the common distinct surfaces that may contradict
  double refused = 0.35;         ///< 1, share from which two maps that look alike are not one
  double least_spread = 0.1;     ///< 1, of the surfaces' normals (Overlap::normals): not in a corridor
  double rival = 0.6;            ///< 1, share of its surfaces at which another relation is as good
  int least_matched = 3;         ///< keyframes of the robot that must match the others' scans
  double min_matched = 0.4;      ///< 1, share of a scan's lines that must meet for that
  int most_scans = 16;           ///< of each map that are compared, spread over what both have in common
  int most_candidates = 6;       ///< relations that are followed at a time
  scan::PlaceSearchOptions search;
  scan::OverlapOptions overlap;
  static MapAlignmentOptions read(const options::Section& section);
};

/// Finds how the map of a robot that does not know where it started lies in the map of the others, from the
/// scans of both. Candidates come from searches of single scans (scan::PlaceSearch). Each is refined by
/// matching many scans, and judged by all surfaces that both maps should show: what agrees, what contradicts,
/// and whether another relation explains as much. So equal walls with other furniture are refused, and a
/// corner that fits in four places stays undecided.
class MapAlignment {
 public:
  explicit MapAlignment(const MapAlignmentOptions& options, const scan::MatchOptions& match = {})
      : options_(options), search_(options.search), matcher_(match) {}

  struct Result {
    AlignmentStatus status = AlignmentStatus::kUndecided;
    std::string reason;
    double score = 0.0;                                        ///< share of the common surfaces that agree
    Pose2 map_from_own;                                        ///< of the best relation; used if matched
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of it, right perturbation at the own map's
                                                               ///< middle; see `middle_m`
    Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();        ///< own frame
  };

  /// Looks at what is new since the last call. Costs some 10 ms if there is a new keyframe.
  /// @param map of the others @param own of the robot
  const Result& update(const KeyframeMap& map, const KeyframeMap& own);

  /// A relation that something else suggests, such as two robots that see each other.
  void suggest(const Pose2& map_from_own);

 private:
  struct Candidate {
    Pose2 map_from_own;
    scan::Overlap overlap;
    int matched = 0;        ///< keyframes
    double spread_m = 0.0;  ///< rms of what single keyframes say about the relation, …
    double spread_rad = 0.0;
    double value() const { return overlap.distinct_agree_m - 2.0 * overlap.distinct_contradict_m; }
  };
  void searchNewest(const KeyframeMap& map, const KeyframeMap& own);
  void consider(const Pose2& map_from_own);
  void refine(const KeyframeMap& map, const KeyframeMap& own, Candidate& candidate);
  void judge(const KeyframeMap& map, const KeyframeMap& own, Candidate& candidate) const;
  bool isSame(const Pose2& a, const Pose2& b) const;
  void decide();

  MapAlignmentOptions options_;
  scan::PlaceSearch search_;
  scan::ScanMatcher matcher_;
  std::size_t own_seen_ = 0, map_seen_ = 0;
  std::size_t searched_ = 0;                            ///< keyframes of the map in search_, …
  std::uint32_t searched_revision_ = 0;                 ///< … as they lay then
  Eigen::Vector2d middle_m_ = Eigen::Vector2d::Zero();  ///< of the own keyframes
  std::vector<Pose2> suggested_;
  std::vector<Candidate> candidates_;  ///< best first
  Result result_;
};

}  // namespace omnifleet::estimation
