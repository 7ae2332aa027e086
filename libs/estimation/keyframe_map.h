#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "observation/observation.h"
#include "options/options.h"
#include "scan/keyframe_graph.h"
#include "scan/line_scan.h"
#include "scan/scan_matcher.h"

namespace omnifleet::estimation {

struct KeyframeOptions {
  double spacing_m = 0.25;       ///< m; a frame farther than this from every keyframe becomes one
  int references = 6;            ///< nearest keyframes that a frame is matched against
  double reach_m = 2.5;          ///< m, of these; farther ones share little and are over-confident
  double pair_reach_m = 1.3;     ///< m; keyframes nearer than this are constrained pair by pair
  int min_lines = 60;            ///< beams with a line that a keyframe needs
  double sigma_m = 0.001;        ///< m, systematic error of a match, …
  double sigma_per_m2 = 0.0015;  ///< 1/m, … and its growth with the square of the distance between the scans
  double sigma_rad = 0.00035;    ///< rad, likewise (0.02°)
  double sigma_rad_per_m2 = 0.00052;  ///< rad/m², likewise (0.03°/m²)
  static KeyframeOptions read(const options::Section& section);
};

/// Scans at known places, of all robots in one map, and the graph that holds these places together. It is the
/// long-term memory of localisation: returning to an old place matches old keyframes, which closes the loop.
class KeyframeMap {
 public:
  using Id = scan::KeyframeGraph::Id;

  explicit KeyframeMap(const KeyframeOptions& options) : options_(options) {}

  /// Nearest keyframes within reach, the nearest first.
  std::vector<Id> near(const Pose2& map_from_base) const;
  scan::Reference reference(Id keyframe) const;
  Pose2 pose(Id keyframe) const { return graph_.pose(keyframe); }
  /// Of the keyframe's pose in map, right perturbation; as of the last add().
  Eigen::Matrix3d covariance(Id keyframe) const { return graph_.covariance(keyframe); }
  std::size_t size() const { return keyframes_.size(); }

  /// Whether a robot's frame should become a keyframe.
  bool wants(const Pose2& map_from_base, const scan::LineScan& scan) const;

  /// What holds a new keyframe besides its scan.
  struct Held {
    std::optional<Id> previous;                                ///< keyframe of the same robot
    Pose2 previous_from_this;                                  ///< by the robot's own estimate since
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of it; without `previous` of map_from_base
  };
  /// Matches the new keyframe against its neighbours and solves the graph. @return its id
  Id add(const std::string& robot, TimeNs time_ns, const Pose2& map_from_base, const Pose2& base_from_scan,
         const scan::LineScan& scan, const Held& held);

  /// Systematic covariance of a match over a distance, right perturbation.
  Eigen::Matrix3d systematic(double distance_m) const;
  /// Largest move of a keyframe by the last add(), metres.
  double moved_m() const { return moved_m_; }

 private:
  struct Keyframe {
    std::string robot;
    TimeNs time_ns = 0;
    Pose2 base_from_scan;
    scan::LineScan scan;
  };
  void constrainPairs(Id id);

  KeyframeOptions options_;
  scan::KeyframeGraph graph_;
  scan::ScanMatcher matcher_;
  std::deque<Keyframe> keyframes_;
  double moved_m_ = 0.0;
};

}  // namespace omnifleet::estimation
