#pragma once

// The fleet estimator: least squares over the poses of all robots, one scale bias per wheel, obstacles as
// support-function prisms and mutual sightings (docs/methods/localizer.md; it stands in for the
// odometry-only localisation of Choi et al. 2014 §IV). A sliding window of frames is solved after every round
// of frames; what leaves the window is marginalised into a dense prior, so time and memory stay bounded; new
// frames are placed at once by what the window says about the present, condensed. Pure and deterministic: one
// thread, fixed iteration counts, no clock.

#include <Eigen/Core>
#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "estimation/appearance_motion.h"
#include "estimation/camera_error.h"
#include "estimation/detector_model.h"
#include "estimation/floor_source.h"
#include "estimation/keyframe_map.h"
#include "estimation/loop_check.h"
#include "estimation/map_alignment.h"
#include "estimation/place_recognition.h"
#include "estimation/relocalizer.h"
#include "estimation/scan_source.h"
#include "estimation/wheel_log.h"
#include "geometry/polygon.h"
#include "geometry/pose2.h"
#include "observation/error_code.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::estimation {

/// What is known of a robot before the run.
struct RobotSetup {
  std::string name;
  RobotBody body;
  std::optional<Pose2> initial_pose;  ///< map_from_base at its first frame; without it the robot is unlocated
                                      ///< until an absolute measurement or a sighting locates it
  bool founds_map = false;  ///< no initial pose is configured: `map` is chosen so that initial_pose holds
  lens::Spread lens{};      ///< of its camera
  /// Of its camera, as in PoseEstimate: estimated before by the process that this one replaces.
  Eigen::Vector4d camera_error = Eigen::Vector4d::Zero();
  bool match_scans = true;  ///< whether its scans correct its pose
};

struct EstimatorOptions {
  double initial_sigma_m = 0.005;       ///< m, of initial_pose, each axis
  double initial_sigma_rad = 0.00524;   ///< rad, of initial_pose (0.3°)
  double wheel_bias_sigma = 0.02;       ///< 1, prior of each wheel's scale error
  double body_sigma = 0.005;            ///< 1, of how large a body is seen, against what it is said to be
  int window_frames = 15;               ///< frames per robot that are re-estimated
  int solver_iterations = 4;            ///< per call, fixed
  double keyframe_distance_m = 0.03;    ///< m; a frame becomes a keyframe after this travel,
  double keyframe_angle_rad = 0.05;     ///< rad; or this turn,
  double keyframe_time_s = 1.0;         ///< s; or this time
  bool use_landmarks = true;            ///< obstacles correct the poses
  bool use_sightings = true;            ///< robots seen by robots correct the poses
  double view_sigma_factor = 3.0;       ///< 1, on the σ of supports: directions and frames correlate
  int view_directions = 48;             ///< directions of each view that enter the graph
  double associate_gate_m = 0.12;       ///< m, between Steiner centres of a view and of a landmark
  double new_landmark_m = 0.22;         ///< m, a view farther than this from all landmarks starts one
  double new_landmark_contact_m = 1.8;  ///< m, and its contact with the floor is nearer than this,
  double new_landmark_robot_m = 0.35;   ///< m, and it is at least this far from every robot
  double sighting_gate_m = 0.25;        ///< m, between a view and a predicted robot
  double sighting_rms_m = 0.05;         ///< m, rms of the fit of the known body below which a view is a robot
  double prior_height_m = 0.15;         ///< m, height of an obstacle before it is seen from two sides
  double prior_height_sigma_m = 0.10;   ///< m
  double moving_mps = 0.08;             ///< m/s, objects faster than this are no landmarks
  int max_landmarks = 64;               ///< the one unseen longest is marginalised beyond this
  int publish_views = 6;                ///< keyframe views before a landmark is listed
  double gate_chi2 = 16.3;              ///< 1, χ² (3 dof, 99.9 %) of a step against the wheels: slip
  double no_wheels_sigma_mps = 0.5;     ///< m/s, without motion: σ of the constant-velocity prior's speed
  double no_wheels_sigma_radps = 0.3;   ///< rad/s, likewise
  double carried_per_s = 0.001;         ///< 1/s, how often a robot that sees nothing is carried away, …
  double carried_m = 0.3;               ///< m, … and how far, rms of each axis,
  double carried_rad = 0.3;             ///< rad, and turned by how much
  WheelLogOptions wheel_log;            ///< of robots whose wheels the estimator integrates itself
  DetectorOptions detector;
  CameraOptions camera;
  KeyframeOptions keyframes;
  ScanSourceOptions scan;
  OdometryQualityOptions odometry;
  FloorSourceOptions floor;
  AppearanceOptions appearance;
  RelocalizerOptions relocalizer;
  PlaceRecognitionOptions places;
  LoopCheckOptions loops;
  MapAlignmentOptions alignment;
  scan::MatchOptions match;  ///< of scans

  static EstimatorOptions read(const options::Section& section);
};

/// An obstacle as a prism standing on the floor, map frame.
struct LandmarkEstimate {
  std::uint32_t id = 0;                                ///< unique in a run, in the order of first sight
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();  ///< Steiner centre of the footprint
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  std::vector<double> support_m;  ///< of the footprint about the centre, for directions 2πk/size(), map axes
  double height_m = 0.0, height_sigma_m = 0.0;
  int views = 0;                       ///< keyframe views it rests on
  std::vector<std::string> observers;  ///< sorted
};

/// A named landmark of range and bearing measurements, map frame.
struct PointEstimate {
  std::string name;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();
  bool surveyed = false;  ///< its place was given
  int views = 0;
};

enum class RobotState : std::uint8_t { kUnlocated, kOk, kSlipping, kLost };

/// Counters and the last verdict of one robot, for service/status.
struct RobotStatus {
  RobotState state = RobotState::kUnlocated;
  Message message;  ///< kNone when ok
  int slips = 0, losses = 0, rejected_measurements = 0, rejected_views = 0, wrong_starts = 0;
};

class FleetEstimator {
 public:
  FleetEstimator(std::vector<RobotSetup> robots, const EstimatorOptions& options);
  ~FleetEstimator();
  FleetEstimator(FleetEstimator&&) noexcept;
  FleetEstimator& operator=(FleetEstimator&&) noexcept;

  /// All samples of one time (frames of any subset of the robots, and measurements up to this time that were
  /// not given before). Times never decrease. Returns one PoseEstimate per frame, in the order given: the
  /// causal estimate at that frame; `valid` is false while the robot is unlocated or its frame is not newer
  /// than its last. A frame whose state is not kOk still carries its motion. Throws std::runtime_error when a
  /// frame names an unknown robot.
  std::vector<PoseEstimate> process(TimeNs time, const std::vector<const Objects*>& frames,
                                    const std::vector<const Measurement*>& measurements);

  /// The rest of the work, for the time after the poses have been handed on: solves the whole window anew,
  /// forms the obstacles' shapes, lets old frames go. process() itself works by what this left behind and the
  /// new frames alone, and calls it first where a robot's last frame has not been through it.
  void refine();
  /// Every robot that is still sending has a frame that has not been through refine().
  bool refineDue() const;

  /// Wheel speeds of a robot whose frames carry no motion: the estimator integrates them itself, between any
  /// two times, and estimates scale, turn and delay. Rows up to a time come before the frames of that time.
  /// Throws std::runtime_error for an unknown robot.
  void addWheels(const std::string& robot, TimeNs time_ns, double left_mps, double right_mps);

  /// Solves to convergence at the end of a run and returns smoothed() of it.
  std::vector<PoseEstimate> finish();

  /// Revised estimates of the frames that are still in the window, by robot then time (`valid` is false where
  /// what is seen contradicts them). Frames that have left
  /// it keep the last value given here.
  std::vector<PoseEstimate> smoothed() const;

  /// Frames that have left the window, or will be in no window again, and whose poses have turned out to be
  /// others than process() gave, by more than a map is exact to; each time since the last call. `valid` is
  /// false where the published poses no longer hold.
  std::vector<PoseEstimate> takeRevised();
  /// What has been found wrong with the configuration (an initial pose, a calibration), a line for
  /// people each;
  /// since the last call.
  std::vector<Message> takeFindings();

  /// Takes a robot over from an estimator of the same fleet that alone has followed it so far, in a frame of
  /// its own: keyframes, the poses of all its frames, which takeRevised() then returns in this map, and its
  /// newest pose. Both estimators have been through refine(). @param covariance of map_from_own near the
  /// robot, right perturbation
  void join(const std::string& robot, const FleetEstimator& own, const Pose2& map_from_own,
            const Eigen::Matrix3d& covariance);
  /// How the frame of another estimator lies in map.
  struct Relation {
    Pose2 map_from_own;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of its right perturbation
  };
  /// The same for a robot that this estimator has located by itself: takes over the poses of its frames only.
  /// @return the relation, by the robot's newest pose in both; nothing where one of them has none
  std::optional<Relation> adoptPath(const std::string& robot, const FleetEstimator& own);
  /// Places of the topological map that are new or have moved since the last call, by robot and index.
  std::vector<Place> takePlaces();
  /// Scans at known places; of all robots.
  const KeyframeMap& keyframes() const;
  /// Places of the topological map, by robot.
  std::vector<const PlaceMemory*> placeMemories() const;
  /// The robot has a pose here.
  bool isLocated(const std::string& robot) const;
  /// Whether mutual sightings may locate a robot without a pose; by default they may.
  void allowSightings(const std::string& robot, bool allow);

  /// Obstacles with at least publish_views views, by id.
  std::vector<LandmarkEstimate> landmarks() const;

  /// Named landmarks, by name.
  std::vector<PointEstimate> points() const;

  /// Scale errors of the wheels (left, right): true distance = measured · (1 + bias).
  Eigen::Vector2d wheelBias(const std::string& robot) const { return wheelModel(robot).head<2>(); }
  WheelModel wheelModel(const std::string& robot) const;
  /// Zero for a robot that has measured no range and bearing.
  DetectorModel detectorModel(const std::string& robot) const;
  /// Position of a target of a robot's detector at a time that is still in its window, in its
  /// base_link then: (range, bearing) without the detector's errors as they are estimated now.
  Eigen::Vector2d seenFrom(const std::string& robot, TimeNs time_ns,
                           const Eigen::Vector2d& range_bearing) const;
  /// Of the robot's camera against its calibration; zero for a robot that has seen nothing.
  CameraError cameraError(const std::string& robot) const;
  /// Its covariance, the prior included; that of the prior for a robot that has seen nothing.
  CameraCovariance cameraCovariance(const std::string& robot) const;
  const RobotStatus& status(const std::string& robot) const;

 private:
  class Impl;
  std::unique_ptr<Impl> impl_;
};

}  // namespace omnifleet::estimation
