#pragma once

#include <Eigen/Core>
#include <array>
#include <deque>
#include <map>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "estimation/appearance_motion.h"
#include "estimation/estimator.h"
#include "estimation/floor_source.h"
#include "estimation/graph.h"
#include "estimation/landmark.h"
#include "estimation/localization_monitor.h"
#include "estimation/path_memory.h"
#include "estimation/place_memory.h"
#include "estimation/place_recognition.h"
#include "estimation/prism_factors.h"
#include "estimation/relocalizer.h"
#include "estimation/scan_source.h"
#include "estimation/view.h"
#include "estimation/wheel_log.h"
#include "estimation/wheel_trial.h"

namespace omnifleet::estimation {

/// A silhouette that takes part in the graph.
struct ViewLink {
  FactorId factor = kNoFactor;
  PrismFactor* cost = nullptr;  ///< owned by the graph
  VariableId observer = 0, object = 0, camera = 0, size = 0;
  std::shared_ptr<View> view;
  std::uint32_t landmark = 0;  ///< 0: a peer
  std::uint32_t track = 0;
  double rms_m = 0.0;    ///< of the last reweighting
  bool weighed = false;  ///< has had its full say in a solve of the whole window
};

/// A turn by the visual compass, as it claims.
struct CompassTurn {
  double turn_rad = 0.0, sigma_rad = 0.0;
};

/// One frame of one robot in the window.
struct Step {
  TimeNs time_ns = 0;
  std::uint32_t sequence = 0;
  VariableId pose = 0;
  FactorId motion = kNoFactor;
  Pose2 previous_from_current;  ///< as predicted (scale errors corrected)
  Pose2 measured;               ///< as measured
  Eigen::Matrix3d motion_covariance = Eigen::Matrix3d::Identity();
  Eigen::Matrix3d own_covariance = Eigen::Matrix3d::Identity();  ///< of it without what people may do unseen
  Eigen::Matrix3d claimed_covariance = Eigen::Matrix3d::Zero();  ///< of the motion, by the wheels
  Eigen::Matrix3d wheel_covariance = Eigen::Matrix3d::Zero();    ///< of the wheels' way
  Eigen::Matrix3d jitter = Eigen::Matrix3d::Zero();              ///< of this frame's place on it
  WheelJacobian by_model = WheelJacobian::Zero();  ///< derivative of `measured` by the wheel model …
  WheelModel model = WheelModel::Zero();           ///< … with which it was measured
  TimeNs since_ns = 0;                             ///< what previous_from_current starts from
  bool wheels = false;                             ///< motion was measured
  bool rejected = false;                           ///< everything else contradicts its measured motion
  bool by_floor = false;           ///< motion by the texture of the floor, which other sources have confirmed
  std::optional<FloorStep> floor;  ///< what the texture of the floor says of it
  bool by_appearance = false;      ///< without wheels: only the images measure turn and length
  double difference = 0.0;         ///< of the signatures since the frame before; 0: not known
  std::optional<CompassTurn> compass;  ///< since the frame before
  bool wheels_rejected = false;        ///< the wheels measured another one, which the observations contradict
  double rolled_m = 0.0, rolled_rad = 0.0;  ///< way and turn if one wheel alone had rolled as both have
  bool keyframe = false;
  bool by_search = false;           ///< placed where the relocalizer has found its scan among keyframes
  std::optional<Pose2> published;   ///< its pose in the newest publication
  std::vector<Sighting> sightings;  ///< as reported
  std::shared_ptr<const Appearance> appearance;  ///< of a frame that becomes a place
  std::vector<ViewLink> views;
  ScanLink scan;

  /// Wheels or floor have measured its motion.
  bool isMeasured() const { return wheels || by_floor; }
  /// … and nothing has contradicted them.
  bool hasOdometry() const { return !rejected && ((wheels && !wheels_rejected) || by_floor); }
};

/// What a track was taken for the last time.
struct Known {
  std::uint32_t landmark = 0;  ///< 0: a robot
  std::size_t robot = 0;       ///< index, where it is one
};

/// A place in a scout's frame and the same in map.
struct ScoutPair {
  TimeNs time_ns = 0;
  std::string of;  ///< the point or the robot that is there, or that has seen the scout there
  Eigen::Vector2d in_local = Eigen::Vector2d::Zero(), in_map = Eigen::Vector2d::Zero();
  double map_variance_m2 = 0.0;  ///< of in_map, each axis
};

/// Where a robot that one other sees may be, before anything else bears it out.
struct ScoutGuess {
  Pose2 map_from_local;
  std::size_t witness = 0;  ///< which robot sees it there
  int frames = 0;           ///< that say so
  TimeNs last_ns = 0;       ///< the last of them
  Eigen::Vector2d own_m = Eigen::Vector2d::Zero(),
                  witness_m = Eigen::Vector2d::Zero();  ///< first; local, map
};

/// What a robot without a pose knows: its way in a frame of its own, and what ties that to the map.
struct Scout {
  TimeNs time_ns = 0;
  Pose2 local_from_base;
  std::deque<ScoutPair> pairs;
  std::optional<ScoutGuess> guess;
};

/// A place elsewhere that a robot may have started at, and how much of what was seen speaks for it.
struct OtherStart {
  Pose2 moved;         ///< from where the robot is said to be, in map (from the left)
  double score = 0.0;  ///< sum over frames of things that agree, less those that are missing
};

/// How a robot's configured initial pose agrees with the observations since.
struct Start {
  std::optional<Pose2> given;  ///< map_from_base of the first frame
  VariableId pose = 0;         ///< of that frame, while it is in the window
  Pose2 moved;                 ///< correction of the configured initial pose, applied from the left
  int agreed = 0;              ///< frames that agree with others
  int unconfirmed = 0;         ///< frames since one agreed
  int doubts = 0;  ///< frames that do not, less those in which some of it agrees and nothing is missing
  double doubted = 0.0, refuted = 0.0;  ///< of late: those that show nothing of the others, and the contrary
  double claim_score = 0.0;             ///< over these
  std::vector<OtherStart> elsewhere;
  bool contradicted = false;          ///< for long, and no other place is sure
  bool borne_out = false;             ///< something from outside has agreed with where it led the robot
  std::vector<PoseEstimate> history;  ///< all published poses, while nothing has confirmed the initial pose
  VariableId anchor = 0;              ///< pose of the last relocalization, until it is final, …
  Pose2 anchored;                     ///< … and its value then
};

/// A silhouette of a robot's newest frame.
struct Glimpse {
  Eigen::Vector2d position_m;  ///< of its track, base_link
  std::shared_ptr<const View> view;
  Footprint footprint;
  bool mature;  ///< clean enough to deny something
};

/// The way of a robot that sees nothing, by its motion alone.
struct Unseen {
  Pose2 map_from_base;                                   ///< when it saw last
  Pose2 way;                                             ///< since
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of both, right perturbation
  double rolled_m = 0.0, turned_rad = 0.0;               ///< sums of the way's steps
};

/// Where a robot that is lost may be.
struct Claim {
  Pose2 map_from_base;
  double gain = 0.0, most = 0.0;  ///< χ² that it explains of what is seen, and all of it; of late
  int frames = 0;                 ///< in which two things at least were where they should be
};

/// A silhouette that may be another robot, when it was taken for it first; map frame.
struct Suspect {
  Eigen::Vector2d place_m;  ///< where it was seen
  Eigen::Vector2d said_m;   ///< where that robot was said to be
};

/// What absolute measurements alone say about a frame.
struct AbsoluteFix {
  Pose2 map_from_base;
  Eigen::Matrix3d covariance;  ///< right perturbation

  /// Of two independent ones.
  static AbsoluteFix fuse(const AbsoluteFix& a, const AbsoluteFix& b);
};

/// A loop that was closed at a frame: the place of that frame, or the next one after it, gets the link.
struct ClosingLink {
  TimeNs time_ns = 0;
  std::size_t robot = 0;  ///< of the other place; index in FleetState::robots
  std::uint32_t index = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of the match, right perturbation
};

/// What the wheels have shown of one robot.
struct WheelAid {
  VariableId model = 0;  ///< WheelModel
  FactorId prior = kNoFactor;
  WheelTrial trial;
  Wiring wiring = Wiring::kAsConfigured;  ///< its last verdict; other wheels count for nothing
  std::optional<WheelLog> log;
  double delay_sigma_s = 0.0;  ///< of the log's delay, after the last solve
};

/// Calibration of one robot's camera.
struct CameraAid {
  VariableId error = 0;                                        ///< CameraError; 0 until it has seen something
  CameraCovariance covariance = CameraCovariance::Identity();  ///< of that error
  Eigen::Vector4d published = Eigen::Vector4d::Zero();         ///< the error, as published
  CameraFinding::Quantities accused;                           ///< what has been reported to be wrong with it
  std::array<int, 4> doubts{};  ///< keyframes in a row in which it seemed wrong, by quantity
  double said = 0.0;            ///< sum of the variances of the last report
};

/// What the images of one robot show of its motion.
struct AppearanceAid {
  DifferenceScale length;
  CompassQuality compass;
};

/// Places and path of one robot: what has been published, and what will be.
struct PlaceAid {
  PlaceMemory memory;
  std::optional<ClosingLink> closing;
  /// Covariance of the motion since the newest place, right perturbation.
  Eigen::Matrix3d way = Eigen::Matrix3d::Zero();
  PathMemory path;  ///< of the frames that have left the window
};

/// Localization state of one robot. Written by localization.cpp; joining.cpp takes it over as a whole.
struct LocalizationAid {
  LocalizationMonitor monitor;
  std::optional<Relocalizer> relocalizer;
  TimeNs confirmed_ns = 0;             ///< of the newest frame at which something confirmed the pose
  PoseEvent event = PoseEvent::kNone;  ///< of the newest frame
  double correction_sigmas = 0.0;      ///< of that event
};

/// Absolute poses, ranges and bearings of one robot.
struct AbsoluteAid {
  std::optional<AbsoluteFix> fix;  ///< of its newest frame
  bool accepted = false;           ///< since its last frame an absolute measurement has been accepted
  SourceSet used, rejected;        ///< sources of the measurements of its newest frame
  int disagreements = 0;           ///< absolute measurements in a row that the gate rejected
  int refusals = 0;                ///< ranges and bearings in a row that the gate rejected
  std::set<std::string> refused;   ///< of which points and robots
};

/// What one robot saw in the newest frame that showed anything.
struct SightAid {
  TimeNs time_ns = 0;
  std::vector<Glimpse> glimpses;
  Scan scan;                ///< how far floor is seen
  double farthest_m = 0.0;  ///< of the silhouettes' positions so far: so far does it see for sure
};

/// What the tracks of one robot are taken for.
struct TrackAid {
  std::map<std::uint32_t, Known> known;                               ///< by track id
  std::map<std::pair<std::uint32_t, std::size_t>, Suspect> suspects;  ///< by track id and robot
  int unobserved = 0;  ///< frames since it has seen enough whose place or motion is known
};

/// Fault detection of a robot that sees objects: slip, kidnapping, lost localization.
struct DoubtAid {
  bool familiar = false;                          ///< it saw something that it knew, before it saw nothing
  bool displaced = false;                         ///< it sees nothing of what should be there, …
  bool adrift = false;                            ///< … or merely its heading may have been anything
  std::vector<Claim> claims;                      ///< displaced, it may be here
  double claimed_m = 0.0;                         ///< rolled since these were weighed last
  double unsettled_m = 0.0, unsettled_rad = 0.0;  ///< rolled since what it sees has fitted last
  int unsure = 0;  ///< after a time without any view: frames in which a kidnapping may still be detected
  TimeNs seeing_ns = 0;          ///< when it could see last
  std::optional<Unseen> unseen;  ///< while it sees nothing or has not been found since
};

/// One robot: its window of frames, and what each source knows of it.
struct RobotNode {
  RobotSetup setup;
  std::shared_ptr<const Body> body;
  VariableId detector = 0;  ///< DetectorModel; 0 until it has measured a range and bearing
  VariableId size = 0;      ///< of its body against what it is said to be; 0 until it has been seen
  std::deque<Step> window;  ///< empty while unlocated
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the newest pose, right perturbation
  TimeNs last_frame_ns = 0;
  Pose2 last_key;
  TimeNs last_key_ns = 0;
  bool started = false;          ///< a frame has come
  bool unrefined = false;        ///< its newest frame is not in the last whole solve
  bool sightings_locate = true;  ///< mutual sightings may locate it
  std::optional<Scout> scout;    ///< while unlocated
  Start start;
  WheelAid wheel_aid;
  FloorSource floor;
  ScanAid scan_aid;
  AppearanceAid appearance_aid;
  CameraAid camera_aid;
  TrackAid track_aid;
  SightAid sight_aid;
  DoubtAid doubt;
  AbsoluteAid absolute_aid;
  PlaceAid place_aid;
  LocalizationAid localization_aid;
  RobotStatus status;

  bool located() const { return !window.empty(); }
  /// Of the source that measured the motion of a step.
  const OdometryQuality& odometryOf(const Step& step) const {
    return step.by_floor ? floor.quality() : scan_aid.odometry;
  }
};

/// A named landmark of range and bearing measurements.
struct Point {
  VariableId variable = 0;  ///< (x, y)
  bool surveyed = false;    ///< its place was given
  int views = 0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< after the last solve
  TimeNs last_seen_ns = 0;
};

/// Where a robot was at some time: a pose variable and a fixed step from it.
struct PoseAt {
  VariableId pose = 0;
  Pose2 offset;  ///< pose ∘ offset is the robot's pose at the time asked for
  Pose2 map_from_base;
  bool extrapolated = false;
};

/// Right perturbation from a covariance over (x, y, θ) in map axes, and back.
Eigen::Matrix3d bodyCovariance(const Eigen::Matrix3d& map_covariance, double theta_rad);

/// What holds `map` where nothing from outside does (map_frame.h).
struct MapFrame {
  VariableId start = 0;            ///< map_from_start of the robot that founded it; 0: none did
  FactorId by_start = kNoFactor;   ///< holds it at that start, or …
  FactorId by_points = kNoFactor;  ///< … at the named points
  std::uint32_t datum = 0;         ///< counts what has held it; 0: it is where the configuration puts it
};

/// Robots, landmarks and points with their variables.
class FleetState {
 public:
  FleetState(std::vector<RobotSetup> robots, const EstimatorOptions& options);

  const EstimatorOptions options;
  Graph graph;
  KeyframeMap keyframes;
  PlaceRecognition recognition;
  LoopCheck loops;
  std::vector<RobotNode> robots;  ///< in the order given
  std::map<std::uint32_t, Landmark> landmarks;
  std::map<std::string, Point> points;  ///< named point landmarks (range and bearing)
  bool tied = false;                    ///< absolute measurements locate the map
  MapFrame map_frame;
  std::vector<PoseEstimate> revised;  ///< poses that differ from what was published, to be published again
  std::vector<Message> findings;      ///< about initial poses and calibrations

  RobotNode* find(const std::string& name);
  const RobotNode* find(const std::string& name) const;
  Pose2 pose(VariableId id) const { return Pose2::fromVector(graph.value(id)); }

  /// A row of a robot's wheels where no stage before the estimator integrates them.
  void addWheels(RobotNode& robot, TimeNs time_ns, double left_mps, double right_mps);
  /// Rows that no step will ask for.
  void forgetWheels();
  /// The variable of the robot's detector, made at its first use.
  VariableId detector(RobotNode& robot);
  /// Likewise of its camera.
  VariableId camera(RobotNode& robot);
  /// Likewise of its body's size.
  VariableId size(RobotNode& robot);
  CameraError cameraError(const RobotNode& robot) const;

  /// The motion of a frame as a step without variables: wheels where valid, else constant velocity.
  Step predictStep(const RobotNode& robot, const Objects& frame) const;
  /// The motion from a time to a frame, of the frame itself or from the log; false if neither has it.
  bool motionBetween(const RobotNode& robot, TimeNs from_ns, const Objects& frame, Pose2& motion) const;
  /// A located robot's next pose.
  void advance(RobotNode& robot, const Objects& frame);
  /// First pose of an unlocated robot; the caller adds what locates it.
  void place(RobotNode& robot, const Objects& frame, const Pose2& map_from_base);
  /// Forgets where a robot is; what its frames said about others is kept.
  void release(RobotNode& robot);

  /// Nothing when the robot is unlocated or the time lies before the window or more than 0.5 s after it.
  std::optional<PoseAt> poseAt(const RobotNode& robot, TimeNs time_ns) const;

  /// How a located robot moves at a time in its window: m/s, m/s, rad/s in its base_link.
  Eigen::Vector3d twistAt(const RobotNode& robot, TimeNs time_ns) const;
  /// Position of a target of a robot's detector at a time, in its base_link then.
  Eigen::Vector2d seenFrom(const RobotNode& robot, TimeNs time_ns,
                           const Eigen::Vector2d& range_bearing) const;

  Landmark& addLandmark(const Eigen::Vector2d& anchor_m, double height_m, double height_sigma_m);
  void removeLandmark(std::uint32_t id);
  /// Two landmarks that stand at one place are one: their centres are tied, then the younger is marginalised.
  void mergeDuplicates();
  /// Landmarks that have moved away, duplicates, and the oldest of too many.
  void forgetLandmarks();
  Pose2 mapFromLandmark(const Landmark& landmark) const;
  double height(const Landmark& landmark) const { return graph.value(landmark.variable)(2); }
  double size(const Landmark& landmark) const { return graph.value(landmark.size)(0); }
  /// Steiner centre of the footprint, map frame.
  Eigen::Vector2d centre(const Landmark& landmark) const;

  void addViewFactor(RobotNode& observer, ViewLink link, std::unique_ptr<PrismFactor> cost);
  /// Takes the silhouettes of a frame that was no keyframe out again.
  void dropViews(Step& step);
  /// Makes all newest frames of this time keyframes when one is: their mutual sightings belong together.
  void shareKeyframes(TimeNs time_ns);
  /// Replaces the newest step's motion factor by one with a larger covariance.
  void loosen(RobotNode& robot, const Eigen::Matrix3d& covariance);
  /// Rejects the wheels' motions of the whole window.
  void disbelieveWheels(RobotNode& robot);
  /// Shapes anew from the views of keyframes.
  void updateShapes();
  /// Marginalises frames beyond the window.
  void slide();

  std::vector<LandmarkEstimate> landmarkEstimates() const;
  /// Covariance of the motion of a robot without wheels over `over_s` seconds, base_link.
  Eigen::Matrix3d unknownMotion(double over_s) const;

 private:
  void forgetPoints();
  void loosen(RobotNode& robot, std::size_t step, const Eigen::Matrix3d& covariance);
  void addOdometryErrors(const RobotNode& robot, Step& step) const;
  /// The motion since step.since_ns from the robot's own log of its wheels; false where that says nothing.
  bool fromLog(const RobotNode& robot, Step& step) const;
  void predictWithoutWheels(const RobotNode& robot, const Step& previous, const Objects& frame,
                            Step& step) const;
  void predictByAppearance(const RobotNode& robot, const Appearance& appearance, Step& step) const;
  Step& newStep(RobotNode& robot, Step step, const Pose2& map_from_base, const Objects& frame);
  void freezeViews(const Step& step);
  void dropScan(RobotNode& robot);

  std::uint32_t next_landmark_ = 1;
};

}  // namespace omnifleet::estimation
