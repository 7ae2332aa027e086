#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "estimation/keyframe_map.h"
#include "estimation/map_compass.h"
#include "estimation/place_memory.h"
#include "estimation/surface_evidence.h"
#include "geometry/pose2.h"
#include "observation/observation.h"
#include "options/options.h"
#include "scan/map_overlap.h"
#include "scan/place_search.h"
#include "scan/scan_matcher.h"
#include "scan/transients.h"

namespace omnifleet::estimation {

struct MapAlignmentOptions {
  bool use = true;               ///< robots without an initial pose are matched with the map of the others
  double least_agree_m = 4.0;    ///< m of distinct surfaces that both maps must show alike
  double most_contradict = 0.2;  ///< 1, share of the common distinct surfaces that may contradict
  double refused = 0.35;         ///< 1, share from which two maps that look alike are not one
  double least_spread = 0.1;     ///< 1, of the surfaces' normals (Overlap::normals): not in a corridor
  double least_evidence = 6.0;  ///< nats, of surfaces and compass: look-alike rooms reach 5.6, one room 8–16
  double most_compass = 2.0;    ///< nats, of these by the compass: rooms with equal walls may look alike, too
  double least_compass = -3.0;  ///< nats, below which the compass contradicts, whatever the surfaces say
  double rival = 0.6;           ///< 1, share of its surfaces at which another relation is as good, …
  /// nats, … unless the compass prefers the better one by so much, at as many pairs of places
  double rival_compass = 3.0;
  int least_matched = 3;     ///< keyframes of the robot that must match the others' scans
  double min_matched = 0.4;  ///< 1, share of a scan's lines that must meet for that
  int most_scans = 16;       ///< of each map that are compared, spread over what both have in common
  int most_candidates = 6;   ///< relations that are followed at a time
  SurfaceEvidence surfaces;
  MapCompassOptions compass;
  scan::PlaceSearchOptions search;
  scan::OverlapOptions overlap;
  /// The search looks for more candidates than relocalization: the evidence decides. It is no coarser: with
  /// cells of 0.1 m and 60 beams it is three times faster, but missed the twin of a symmetric room.
  MapAlignmentOptions() {
    search.min_score = 0.4;
    search.most = 6;
  }
  static MapAlignmentOptions read(const options::Section& section);
};

/// A map to be compared: scans and places of the same robots. Kept by reference.
struct MapToAlign {
  const KeyframeMap& keyframes;
  std::vector<const PlaceMemory*> places = {};
};

/// Finds how the map of a robot without initial pose lies in the map of the others, from the scans and
/// signatures of both. Candidates come from searches of single scans of one map among those of the other
/// (scan::PlaceSearch), and from searches in the robot's own map: where it is symmetric, each candidate has a
/// twin. Each is refined by matching many scans, and judged by all surfaces that both maps should show, by
/// the visual compass at places near each other, and by its rivals. Surfaces that were there for a short time
/// only do not count: robots that do not know of each other see each other as furniture. So equal walls with
/// other furniture are refused, and a symmetric room stays undecided unless the images distinguish its sides.
class MapAlignment {
 public:
  explicit MapAlignment(const MapAlignmentOptions& options, const scan::MatchOptions& match = {})
      : options_(options),
        map_side_(options),
        own_side_(options),
        matcher_(match),
        compass_(options.compass) {}

  struct Result {
    AlignmentStatus status = AlignmentStatus::kUndecided;
    std::string reason;
    double score = 0.0;                                        ///< share of the common surfaces that agree
    Pose2 map_from_own;                                        ///< of the best relation; used if matched
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of it, right perturbation at the own map's
                                                               ///< middle; see `middle_m`
    Eigen::Vector2d middle_m = Eigen::Vector2d::Zero();        ///< own frame
  };

  /// Looks at what is new since the last call. Costs some 100 ms if there is a new keyframe.
  /// @param map of the others @param own of the robot
  const Result& update(const MapToAlign& map, const MapToAlign& own);

 private:
  struct Candidate {
    Pose2 map_from_own;
    scan::Overlap overlap;
    MapCompass::Opinion compass;
    double evidence = 0.0;  ///< nats, of surfaces and compass, against another room
    int matched = 0;        ///< keyframes
    double spread_m = 0.0;  ///< rms of what single keyframes say about the relation, …
    double spread_rad = 0.0;
  };
  /// One of both maps, as it is searched and compared.
  struct Side {
    explicit Side(const MapAlignmentOptions& options) : places(options.search), transients(options.overlap) {}
    scan::PlaceSearch places;
    scan::Transients transients;
    std::size_t size = 0;        ///< keyframes of the map in it, …
    std::uint32_t revision = 0;  ///< … as they lay then
    void hold(const KeyframeMap& map);
    /// Relations held_from_other by a scan of another map. @param turn_rad of other against held, and how far
    /// about it is searched
    std::vector<Pose2> find(const scan::Reference& scan, double turn_rad = 0.0,
                            double reach_rad = M_PI) const;
    scan::View view(const KeyframeMap& map, KeyframeMap::Id keyframe) const {
      return {map.reference(keyframe), &transients.of(keyframe)};
    }
  };
  void addCandidates(const KeyframeMap& map, const KeyframeMap& own);
  void consider(const Pose2& map_from_own);
  void refine(const KeyframeMap& map, const KeyframeMap& own, Candidate& candidate);
  void judge(const MapToAlign& map, const Side& map_side, const MapToAlign& own, Candidate& candidate);
  void updateSymmetries(const MapToAlign& own);
  bool isSame(const Pose2& a, const Pose2& b) const;
  bool isPossible(const Candidate& candidate) const;
  bool isDistinguished(const MapCompass::Opinion& best, const MapCompass::Opinion& other) const;
  bool isRival(const Candidate& best, const Candidate& other) const;
  void decide();

  MapAlignmentOptions options_;
  Side map_side_, own_side_;                 ///< of the others, and of the robot
  std::size_t map_seen_ = 0, own_seen_ = 0;  ///< keyframes at the last call
  std::size_t searched_again_ = 0;           ///< scans
  scan::ScanMatcher matcher_;
  MapCompass compass_;
  Eigen::Vector2d middle_m_ = Eigen::Vector2d::Zero();  ///< of the own keyframes
  std::vector<Candidate> candidates_;                   ///< best first
  std::vector<Candidate>
      symmetries_;  ///< relations of the robot's map to itself; map_from_own is own_from_own
  Result result_;
};

}  // namespace omnifleet::estimation
