#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "estimation/graph.h"
#include "estimation/keyframe_map.h"
#include "estimation/odometry_quality.h"
#include "scan/line_scan.h"
#include "scan/place_search.h"
#include "scan/scan_matcher.h"

namespace omnifleet::estimation {

class FleetState;
struct RobotFrame;
struct RobotNode;
struct Step;

struct ScanSourceOptions {
  bool use = true;  ///< scans correct the poses
  /// Those of forward cameras as well. They see a quarter of the surroundings from 8 cm above the floor: two
  /// straight walls at most, so matches slide along them and find other walls. Measured: with them, robots
  /// without wheels were metres off 10 s after their ceiling camera failed, at a σ of 2 cm, and paths under
  /// ceiling cameras were worse (0.4 mm; without 0.07 mm).
  bool front = false;
  double min_matched = 0.4;  ///< 1, share of a scan's beams with a line that must meet a line of a keyframe
  double max_chi2 = 6.0;     ///< 1, mean squared residual of these, in σ²
  double shift_m = 0.08;     ///< m, largest correction of a prediction, …
  double shift_per_step = 0.3;  ///< 1, … plus this share of the step
  double turn_rad = 0.105;      ///< rad, largest correction of a heading (6°), …
  double turn_per_step = 0.5;   ///< 1, … plus this share of the turn
  /// 1, share of the bearings that must show lines off free-standing objects so that landmarks are not
  /// needed. Few surfaces have few independent errors, whatever their number of beams.
  double suffices_share = 0.25;
  double suffices_m = 0.003;    ///< m, σ of a pose by these lines, at most; …
  double suffices_rad = 0.003;  ///< rad, … of its heading
  double confirms_chi2 = 4.0;   ///< χ² of a correction, at most, that needs only half of min_matched
  double nearly_all = 0.8;      ///< 1, share of lines that are matched without doubt: …
  double wider = 2.0;           ///< 1, … the correction may be so many times larger
  double missed_chi2 = 0.7;     ///< χ² of a line that meets none when matches compete; neighbours are alike
  double known = 0.5;           ///< 1, share of beams into seen space from which a missing match contradicts
  double basin_m = 0.12;        ///< m, 3 σ of a prediction from which the area around it is searched, …
  double basin_rad = 0.1;       ///< rad, … or of its heading
  double search_m = 3.0;        ///< m, radius of that search, at most; beyond is the relocalizer's task
  double full_rank_m = 0.01;  ///< m, σ of a match in every direction that relates keyframes without odometry
  /// rad, σ of a laser's bearing: half of its spot (SICK LMS 200: 0.5°), and its turn while it scans.
  /// Measured: with 0.3° the NEES of two drives through buildings fell from 18 to 9 and from 7 to 4.
  double laser_bearing_sigma_rad = 0.005;
  static ScanSourceOptions read(const options::Section& section);
};

/// A match of a step's scan, as a factor of the window.
struct ScanLink {
  FactorId factor = kNoFactor;
  KeyframeMap::Id keyframe = 0;  ///< nearest of those that it was matched against
  Pose2 keyframe_from_base;      ///< as matched
  Eigen::Matrix3d information;   ///< of the scan alone, right perturbation
  Eigen::Vector3d gradient;      ///< information · (scan's optimum − match)
  Eigen::Matrix3d systematic;    ///< covariance
  Pose2 map_from_keyframe;       ///< that the factor assumes
};

/// What the scan source knows of one robot. Written by ScanSource alone.
struct ScanAid {
  scan::LineScan scan;  ///< of the newest frame
  Pose2 base_from_scan;
  bool has_scan = false;     ///< the newest frame shows enough lines
  bool rich = false;         ///< the newest scan shows enough off free-standing objects
  bool held = false;         ///< scans have related it to keyframes
  double scatter = 4.0;      ///< of its last match; before the first one a usual value
  OdometryQuality odometry;  ///< estimated from corrections by matches
  /// By the wheels alone since a keyframe of this robot; none where the wheels did not measure some step.
  std::optional<KeyframeMap::Odometry> way;
  bool matched = false;       ///< it agrees with keyframes around the predicted pose
  bool contradicted = false;  ///< keyframes are around, but it does not agree with them
  bool suffices = false;      ///< matched, and determined without free-standing objects
  std::vector<KeyframeMap::Id> references;
  std::vector<std::uint8_t> on_object;  ///< per beam: ends at a free-standing object
  Eigen::Matrix3d relative_covariance = Eigen::Matrix3d::Zero();  ///< of the newest pose to the keyframes
  /// The newest pose relative to a keyframe: by the last match, then by odometry.
  struct Anchor {
    KeyframeMap::Id keyframe = 0;
    Pose2 map_from_keyframe;  ///< that the window assumes
    Pose2 keyframe_from_base;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
    bool by_match = false;  ///< determined by a match since the keyframe was made
  };
  std::optional<Anchor> anchor;
  Boundary seen;                                      ///< of the newest frame, as seen
  std::vector<bool> usable;                           ///< its beams that do not end at robots
  Eigen::Vector4d assumed = Eigen::Vector4d::Zero();  ///< calibration error that is taken off the scans
  double camera_height_m = 0.0;
  std::vector<float> previous_inverse;  ///< boundary of the frame before, for the turn without wheels
};

/// Scan matching against keyframes (docs/methods/localizer.md). Each frame's boundary is matched with the
/// nearest keyframes and becomes a factor on its pose. Keyframes are fixed in the window; their own errors
/// are added to the published covariance. Factors of scans leave with their frames, so the window holds no
/// more than the last seconds of them, and moves along when the keyframes move.
class ScanSource {
 public:
  explicit ScanSource(const ScanSourceOptions& options, const scan::MatchOptions& match = {})
      : options_(options), matcher_(match) {}

  /// Fits lines to the newest frame, matches it, and adds the factor. After the pose is predicted.
  void observe(FleetState& fleet, RobotFrame& frame);
  /// Makes keyframes of newest frames that are far from all, and follows the keyframes that moved.
  void keep(FleetState& fleet);
  /// To be called before a robot's pose is put elsewhere: its odometry relates it to no keyframe any more.
  static void forget(RobotNode& robot);
  /// Robot's covariance in map: relative to the keyframes, and theirs.
  static Eigen::Matrix3d inMap(const FleetState& fleet, const RobotNode& robot);

 private:
  void fit(const FleetState& fleet, RobotFrame& frame);
  std::optional<double> turnByShift(const Boundary& boundary, const ScanAid& aid, double reach_rad) const;
  void match(FleetState& fleet, RobotFrame& frame, const Boundary& boundary);
  scan::Match align(const ScanAid& aid, const Step& step, const Boundary& boundary, const Pose2& predicted,
                    const Eigen::Matrix3d& covariance, const std::vector<std::uint8_t>& skip);
  Eigen::Vector2d gates(const Step& step, const Eigen::Matrix3d& covariance) const;
  bool refutesStep(const scan::Match& match, const Pose2& predicted, const Eigen::Matrix3d& covariance,
                   const Eigen::Vector2d& gates, double gate_chi2) const;
  bool contradicts(const scan::Match& match, const Pose2& predicted, const Eigen::Matrix3d& prior) const;
  bool accept(const scan::Match& match, const Pose2& predicted, const Eigen::Matrix3d& prior,
              const Eigen::Vector2d& gates) const;
  static void followOdometry(ScanAid& aid, const Step& step);
  void link(FleetState& fleet, RobotNode& robot, const scan::Match& match);
  static void assumeCameras(FleetState& fleet);
  void weighCameras(FleetState& fleet);
  static void followKeyframes(FleetState& fleet, RobotNode& robot);

  ScanSourceOptions options_;
  scan::ScanMatcher matcher_;
  scan::PlaceSearch search_;
  FactorId camera_factor_ = kNoFactor;  ///< what keyframes say about the cameras
  std::size_t weighed_ = 0;             ///< keyframes of which it speaks
  Boundary corrected_;
  std::vector<scan::Reference> references_;
};

}  // namespace omnifleet::estimation
