#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <deque>
#include <optional>
#include <string>
#include <vector>

#include "lens/spread.h"
#include "observation/observation.h"
#include "options/options.h"
#include "scan/keyframe_graph.h"
#include "scan/line_scan.h"
#include "scan/scan_matcher.h"

namespace omnifleet::estimation {

struct KeyframeOptions {
  double spacing_m = 0.25;     ///< m; a frame farther than this from every keyframe becomes one
  int references = 6;          ///< nearest keyframes that a frame is matched against
  double reach = 1.3;          ///< 1, … not farther away than so many mean ranges of their scans
  double trust_m = 0.15;       ///< m, σ of the place of a reference relative to the robot, at most
  double pair_reach = 0.68;    ///< 1, mean ranges; nearer keyframes are constrained pair by pair, …
  int pairs = 16;              ///< … at most so many, the nearest
  double pair_matched = 0.3;   ///< 1, share of lines that a pair must have in common, …
  double calibrates = 0.5;     ///< 1, … and from which it says something about calibrations
  double least_overlap = 0.3;  ///< 1, share of a frame's bearings that a reference has measured, at least
  double same_view = 0.7;      ///< 1, of a keyframe that makes another one there needless
  int min_lines = 60;          ///< beams with a line that a keyframe needs
  double sigma_share = 0.13;   ///< 1, systematic error of a match in units of the σ of a beam, …
  double sigma_growth = 5.4;  ///< 1, … its growth with the square of (distance of the scans / mean range), …
  double sigma_turn = 0.67;        ///< 1, … and of its heading in units of (error / mean range)
  double least_baseline_m = 0.15;  ///< m; nearer pairs are no evidence about calibrations
  /// 1; the evidence of pairs about calibrations is divided by it: pairs that share a scan are not
  /// independent
  double correlated = 8.0;
  static KeyframeOptions read(const options::Section& section);
};

/// Derivative of the scan's pose by that of base_link, right perturbations. The scan has base_link's axes.
Eigen::Matrix3d scanByBase(const Pose2& base_from_scan);

/// Systematic covariance of a match with a scan over a distance, right perturbation: errors that the beams
/// share. They grow with the distance, because the two scans then show other sides of the objects.
Eigen::Matrix3d systematicCovariance(const scan::LineScan& scan, double distance_m,
                                     const KeyframeOptions& options);

/// Scans at known places, of all robots in one map, and the graph that holds these places together. It is the
/// long-term memory of localisation: returning to an old place matches old keyframes, which closes the loop.
class KeyframeMap {
 public:
  using Id = scan::KeyframeGraph::Id;

  explicit KeyframeMap(const KeyframeOptions& options, const scan::MatchOptions& match = {})
      : options_(options), matcher_(match) {}

  /// Where a frame is, and which bearings it has measured (LineScan::sectors).
  struct Viewpoint {
    Pose2 map_from_base;
    std::uint64_t sectors = ~std::uint64_t{0};
    Viewpoint(const Pose2& pose, std::uint64_t measured = ~std::uint64_t{0})  // NOLINT: a pose sees all
        : map_from_base(pose), sectors(measured) {}
  };

  /// Keyframes to match a frame against, the nearest first: within reach, and with a place relative to `from`
  /// that is known to trust_m. That uncertainty is the smallest sum of variances of the constraints on a path
  /// through the graph. So the far end of an open loop is no reference, however near it seems.
  /// @param from a keyframe relative to which the frame is known @param variance_m2 how well
  /// @param count at most so many; 0: options.references
  std::vector<Id> references(Id from, double variance_m2, const Viewpoint& at, int count = 0) const;
  /// The same for a robot that knows its pose in map only. @param variance_m2 of its position
  std::vector<Id> references(double variance_m2, const Viewpoint& at) const;

  /// Of some keyframes those within reach that look the same way, the nearest first. @param most at most so
  /// many; 0: options.references
  std::vector<Id> nearest(const Viewpoint& at, const std::vector<Id>& candidates, int most = 0) const;
  std::vector<Id> all() const;
  /// Keyframes within a radius that are no references of a frame known relative to `from`: the place relative
  /// to them is too uncertain. A robot that returns there closes a loop.
  std::vector<Id> unrelated(Id from, double variance_m2, const Pose2& map_from_base, double radius_m) const;

  scan::Reference reference(Id keyframe) const;
  const Pose2& pose(Id keyframe) const { return graph_.pose(keyframes_[keyframe].node); }
  /// Of the keyframe's pose in map, right perturbation; as of the last solution.
  const Eigen::Matrix3d& covariance(Id keyframe) const;
  std::size_t size() const { return keyframes_.size(); }
  const KeyframeOptions& options() const { return options_; }

  /// Whether a frame should become a keyframe: no reference is near, and the scan shows enough.
  bool wants(const Viewpoint& at, const std::vector<Id>& references, const scan::LineScan& scan) const;

  /// The way from a keyframe of the same robot by its wheels alone.
  struct Odometry {
    Id previous = 0;
    Pose2 previous_from_this;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of the wheels, without jitter
  };
  /// What holds a new keyframe besides the scans of its neighbours.
  struct Held {
    std::optional<Id> previous;  ///< a keyframe
    Pose2 previous_from_this;    ///< by a match since, or by motion without wheels
    /// Of it; without `previous` and `odometry` of map_from_base.
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
    std::optional<Odometry> odometry;
  };
  /// A scan as it was seen, and the camera that saw it.
  struct Source {
    std::uint32_t camera = 0;  ///< of which robot; they count from 0
    Boundary seen;
    std::vector<bool> usable;  ///< beams
    Pose2 base_from_scan;
    double camera_height_m = 0.0;  ///< 0: a laser
    lens::Spread lens;
    Eigen::Vector4d assumed = Eigen::Vector4d::Zero();  ///< calibration error taken off
    bool rich = true;  ///< shows enough surfaces to say something about calibrations
  };
  /// Matches the new keyframe against its neighbours and solves the graph.
  /// @param scan lines of `source`, corrected for `assumed` @param references of the frame @return its id
  Id add(const Pose2& map_from_base, Source source, const scan::LineScan& scan, const Held& held,
         const std::vector<Id>& references);
  /// Covariance of where a robot's wheels say a frame was, relative to their own way: wheels that are read at
  /// another time than the scans are wrong about each frame, but not about the way.
  void setJitter(std::uint32_t robot, const Eigen::Matrix3d& covariance);
  /// Takes another calibration error off all scans of a camera and solves the graph.
  void assume(std::uint32_t camera, const Eigen::Vector4d& error);
  /// What the keyframes say about calibrations.
  scan::CameraEvidence cameraEvidence() const;
  /// Takes over all keyframes of another map, as robots that did not know how their frames lie to each other
  /// find out. Pairs of both maps are matched and hold them together; without any, the nearest two keyframes
  /// are related by map_from_other. @param covariance of map_from_other at these two, right perturbation
  /// @return id of the first one here; the others follow in their order
  Id append(const KeyframeMap& other, const Pose2& map_from_other, const Eigen::Matrix3d& covariance);
  /// A match of two keyframes that no odometry relates well: closes a loop and solves the graph.
  void closeLoop(Id from, Id to, const Pose2& from_to, const Eigen::Matrix3d& covariance);

  /// See systematicCovariance().
  Eigen::Matrix3d systematic(Id keyframe, double distance_m) const;
  /// m; scans farther away from a keyframe have too little in common with it.
  double reachM(Id keyframe) const;
  double reachM() const;  ///< m, largest of all keyframes
  /// Counts solutions that moved a keyframe noticeably.
  std::uint32_t revision() const { return revision_; }

 private:
  struct Edge {
    Id to;
    double variance_m2;
  };
  struct Keyframe {
    scan::KeyframeGraph::Id node;                     ///< its pose in the graph
    std::optional<scan::KeyframeGraph::Id> odometry;  ///< where the wheels were then, …
    std::size_t beside = 0;                           ///< … and the constraint between both
    Source source;
    scan::LineScan scan;
    scan::BeamFields fields;
    std::uint64_t sectors;
    std::vector<Edge> edges;  ///< by scans, …
    std::vector<Edge> ways;   ///< … and by the wheels' own way, from `odometry` to `odometry`
  };
  double overlap(const Viewpoint& at, Id keyframe) const;
  std::vector<bool> related(Id from, double variance_m2) const;
  void relate(Id from, Id to, const Pose2& from_to, const Eigen::Matrix3d& covariance,
              const scan::CameraDependence* cameras = nullptr);
  Eigen::Matrix3d jitter(Id keyframe) const;
  scan::KeyframeGraph::Id odometryNode(Id keyframe);
  void chainOdometry(Id id, const Odometry& odometry);
  /// @return whether some pair is constrained
  bool constrainPairs(Id id, const std::vector<Id>& known);
  void relateNearest(Id first, const Eigen::Matrix3d& covariance);
  void solve();

  KeyframeOptions options_;
  scan::KeyframeGraph graph_;
  scan::ScanMatcher matcher_;
  std::deque<Keyframe> keyframes_;
  std::vector<Eigen::Matrix3d> jitter_;  ///< by robot
  std::uint32_t revision_ = 0;
  mutable std::vector<std::optional<Eigen::Matrix3d>> covariance_;  ///< computed on demand
};

}  // namespace omnifleet::estimation
