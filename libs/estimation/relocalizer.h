#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <optional>
#include <vector>

#include "estimation/keyframe_map.h"
#include "estimation/scan_source.h"
#include "geometry/pose2.h"
#include "options/options.h"
#include "scan/place_search.h"
#include "scan/scan_matcher.h"

namespace omnifleet::estimation {

struct RelocalizerOptions {
  double min_score = 0.6;      ///< 1, of a candidate of the search
  double min_matched = 0.6;    ///< 1, share of a scan's lines that must meet lines of keyframes there
  double rival = 0.8;          ///< 1, of the best share: another place that reaches it is as good
  double look_every_m = 0.3;   ///< m of travel between two searches, at least; …
  double look_share = 0.1;     ///< 1, … and as a share of the extent of the search
  double confirm_m = 0.5;      ///< m of travel over which a place must agree, at least; …
  double confirm_share = 0.1;  ///< 1, … and as a share of the extent of the search: large maps repeat; …
  double confirm_rad = 1.0;    ///< rad, … or so much turn
  int confirm_frames = 3;      ///< frames that must agree
  scan::PlaceSearchOptions search;
  static RelocalizerOptions read(const options::Section& section);
};

/// Finds a robot again whose pose is wrong or too uncertain to match keyframes around it: by a search of its
/// scan among keyframes, followed over travel. A place is found only if it keeps matching and no other place
/// matches nearly as well. It serves kidnapped robots and returns after long paths.
class Relocalizer {
 public:
  explicit Relocalizer(const RelocalizerOptions& options, const scan::MatchOptions& match = {})
      : options_(options), search_(options.search), matcher_(match) {}

  struct Found {
    Pose2 map_from_base;
    KeyframeMap::Id keyframe = 0;  ///< the nearest one that matches
    Pose2 keyframe_from_base;
    Eigen::Matrix3d covariance;  ///< of keyframe_from_base
  };

  /// Where something else than the scan suggests that the robot is.
  struct Suggestion {
    Pose2 map_from_base;
    double reach_m = 0.0, reach_rad = 0.0;  ///< about it
  };
  using Suggest = std::function<std::vector<Suggestion>()>;

  /// One frame. @param aid with the frame's scan @param predicted map_from_base @param motion since the frame
  /// before @param among keyframes to search @param reach_m, reach_rad about `predicted`
  /// @param suggest called when a search is due; places suggested are searched as well
  std::optional<Found> look(const KeyframeMap& map, const ScanAid& aid, const Pose2& predicted,
                            const Pose2& motion, const std::vector<KeyframeMap::Id>& among, double reach_m,
                            double reach_rad, const Suggest& suggest = {});
  void forget();
  /// Drops the place that was found last, because something else contradicts it. @return the next best one
  std::optional<Found> reject();

 private:
  struct Hypothesis {
    Pose2 map_from_base;
    int agreed = 0, missed = 0;
    double travelled_m = 0.0, turned_rad = 0.0;
    double matched = 0.0;  ///< mean share over the frames that agreed
    KeyframeMap::Id keyframe = 0;
    Pose2 keyframe_from_base;
    Eigen::Matrix3d covariance;
  };
  bool follow(const KeyframeMap& map, const ScanAid& aid, const std::vector<KeyframeMap::Id>& among,
              Hypothesis& hypothesis);
  static double extentOf(const KeyframeMap& map, const std::vector<KeyframeMap::Id>& among, double reach_m);
  void prepareSearch(const KeyframeMap& map, const std::vector<KeyframeMap::Id>& among);
  void search(const KeyframeMap& map, const ScanAid& aid, const std::vector<KeyframeMap::Id>& among,
              const Suggestion& about);
  std::optional<Found> decide();
  std::optional<std::size_t> best() const;

  RelocalizerOptions options_;
  scan::PlaceSearch search_;
  scan::ScanMatcher matcher_;
  std::vector<KeyframeMap::Id> searched_;  ///< references of search_
  std::uint32_t revision_ = 0;
  std::vector<Hypothesis> hypotheses_;
  std::optional<std::size_t> found_;  ///< hypothesis that the last look() returned
  double confirm_m_ = 0.0;            ///< of travel over which a place must agree
  double since_look_m_ = std::numeric_limits<double>::infinity();
};

}  // namespace omnifleet::estimation
