#pragma once

// Data that the stages exchange, as plain C++ types. The IDL types map one to one onto them
// (services/adapters). base_link lies on the floor under the middle of the wheel axle: x forward, y left, z
// up.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/polygon.h"
#include "geometry/pose2.h"
#include "observation/appearance.h"
#include "observation/boundary.h"
#include "observation/sources.h"
#include "observation/support_function.h"

namespace omnifleet {

using TimeNs = std::int64_t;  ///< Acquisition time on the data clock, nanoseconds.

/// Validity of a sample. kOk is the only valid state. Every stage publishes one sample per frame and passes
/// the state on.
enum class FrameState : std::uint8_t {
  kOk = 0,
  kMissing,     ///< listed, but the file does not exist
  kUnreadable,  ///< exists, but cannot be decoded
  kWrongSize,   ///< size differs from the calibration
  kEmpty,       ///< no pixels
  kNonFinite,   ///< NaN or infinity in a number that must be finite
  kDark,        ///< black or occluded
  kOverexposed,
  kTorn,  ///< overwritten while it was read
  kOutOfOrder,
};
const char* toString(FrameState state);

/// Motion of the robot since its previous frame, from the wheels. Optical flow or a compass correct it where
/// they improve it.
struct Motion {
  bool valid = false;                                        ///< false on the first frame and after a gap
  TimeNs since_ns = 0;                                       ///< acquisition time of the previous frame
  Pose2 previous_from_current;                               ///< base_link(previous) ← base_link(current)
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of the right perturbation (x, y, θ); m, rad
  double left_m = 0.0, right_m = 0.0;  ///< distance that each wheel has rolled, metres (0 without wheels)
  bool wheels_rejected = false;        ///< The surrounding objects contradict the wheels. The motion is then
                                       ///< estimated from the objects, or unknown (`valid` is false).
};

/// Motion of the robot since its previous frame, from the texture of the floor.
struct FloorMotion {
  bool valid = false;                                    ///< false without texture, and after a gap
  TimeNs since_ns = 0;                                   ///< acquisition time of the previous frame
  Pose2 previous_from_current;                           ///< base_link(previous) ← base_link(current)
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of the right perturbation (x, y, θ); m, rad
};

/// The same as a motion by wheels that have not rolled.
inline Motion asMotion(const FloorMotion& floor) {
  Motion motion;
  motion.valid = floor.valid;
  motion.since_ns = floor.since_ns;
  motion.previous_from_current = floor.previous_from_current;
  motion.covariance = floor.covariance;
  return motion;
}

/// A point on the surface of an object.
struct ScenePoint {
  Eigen::Vector3f point_m = Eigen::Vector3f::Zero();  ///< base_link; z is the height over the floor
  float sigma_m = 0.0f;  ///< along the line of sight, the least certain direction; ≤ 0: the point is unknown
};

/// One feature point tracked by Lucas–Kanade, mapped to the floor (Choi eq. 6–7 with the projection model of
/// the camera).
struct FlowVector {
  Eigen::Vector2f from_px, to_px;  ///< previous and current frame
  Eigen::Vector2f from_m, to_m;    ///< on the floor, each in the base_link of its own frame
  Eigen::Vector2f residual_m;  ///< to_m minus from_m moved by the robot's own motion: zero for floor points
  ScenePoint point;            ///< position in space, from the displacement since tracking began
};

/// One labelled region of one frame.
struct ObjectObservation {
  std::uint16_t label = 0;
  int rect_x_px = 0, rect_y_px = 0, rect_width_px = 0, rect_height_px = 0;
  Polygon hull_m;  ///< convex hull of the silhouette on the floor, base_link, CCW
  Eigen::Vector2d centroid_m =
      Eigen::Vector2d::Zero();  ///< Choi eq. 8 over the pixels of the region, on the floor
  Eigen::Vector2d contact_m =
      Eigen::Vector2d::Zero();  ///< nearest point of the inner edge: the contact with the floor
  SupportFunction supports;
  double solidity =
      1.0;  ///< area of the silhouette ÷ area of its hull, both on the floor; < 0.94: merged blob
  bool truncated = false;                       ///< touches the edge of the valid image or the self mask
  double height_m = 0.0, height_sigma_m = 0.0;  ///< from the lengths of the flow vectors; σ ≤ 0: unknown
  std::vector<FlowVector> vectors;
};

enum class RayLabel : std::uint8_t {
  kInvalid = 0,   ///< no information in this direction
  kFloorEnd = 1,  ///< floor seen up to the range, nothing hit
  kObstacle = 2,
  kRobot = 3,
  kUnknown = 4,    ///< an object of undecided kind
  kUndecided = 5,  ///< floor seen up to the range; beyond it, floor or an object that resembles it
  kBeyond = 6      ///< the floor ends at the range; nearer, something low or flat hides a part of it
};
/// Whether something stands at the end of a ray, other than a robot of the fleet.
constexpr bool isSolid(RayLabel label) {
  return label == RayLabel::kObstacle || label == RayLabel::kUnknown || label == RayLabel::kBeyond;
}

/// Range per bearing from the foot of the camera, in base_link: bearing_i = 2πi/N.
struct Scan {
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();  ///< foot of the camera (or laser) in base_link
  /// Metres from `origin`. Within this radius the own body hides the floor in at least one direction. Of an
  /// object there, only the part that reaches beyond the radius is seen. 0: nothing is hidden.
  double blind_m = 0.0;
  std::vector<float> range_m;
  std::vector<float> sigma_m;
  std::vector<RayLabel> label;
  std::vector<std::uint16_t>
      object;  ///< label (local_map) or track id (objects) of the object that was hit; 0: none
};

struct LocalMap {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  FrameState state = FrameState::kOk;
  double camera_height_m = 0.0;  ///< H of the prism model: height of the camera over the floor
  Motion motion;
  FloorMotion floor_motion;
  std::vector<ObjectObservation> objects;
  Scan scan;
  Boundary boundary;  ///< for scan matching
  Appearance appearance;
};

enum class ObjectKind : std::uint8_t { kUnknown = 0, kObstacle = 1, kRobot = 2 };
const char* toString(ObjectKind kind);

/// One object tracked by one robot, in the base_link of that robot at the time of the frame.
struct Track {
  std::uint32_t id = 0;  ///< unique per robot, never reused within a run
  ObjectKind kind = ObjectKind::kUnknown;
  double kind_probability = 0.0;  ///< probability of `kind`
  /// True if observed in this frame. Otherwise predicted, without support values. A robot at its
  /// reported pose counts as predicted if only an undecided object is seen there.
  bool visible = false;
  Eigen::Vector2d position_m = Eigen::Vector2d::Zero();      ///< footprint centre
  Eigen::Vector2d velocity_mps = Eigen::Vector2d::Zero();    ///< over ground, base_link axes
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< of the position
  Eigen::Vector2d contact_m = Eigen::Vector2d::Zero();
  Polygon hull_m;
  SupportFunction supports;
  double solidity = 1.0;
  bool truncated = false;
  double height_m = 0.0, height_sigma_m = 0.0;
  std::vector<ScenePoint> points;  ///< surface points estimated in this frame
  std::string name;                ///< of a landmark that is distinguishable from all others; otherwise empty
};

struct Objects {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  FrameState state = FrameState::kOk;
  double camera_height_m = 0.0;
  Motion motion;
  FloorMotion floor_motion;
  std::vector<Track> tracks;
  Scan scan;  ///< with decided labels; `object` is the track id
  Boundary boundary;
  Appearance appearance;
};

struct Sighting {
  std::uint32_t track_id = 0;
  std::string robot;
};

/// What the pose of a robot rests on.
enum class LocalizationState : std::uint8_t {
  kUnlocated = 0,     ///< no pose yet
  kLocalized = 1,     ///< scan, landmarks, other robots or absolute measurements confirm the pose
  kOdometryOnly = 2,  ///< only odometry determines the pose; its covariance grows
  kLost = 3,          ///< neither observations nor odometry determine the pose
  kRelocalized = 4    ///< the first frame after the pose was found again
};
const char* toString(LocalizationState state);

/// Why a pose differs from what the poses before it and odometry predict.
enum class PoseEvent : std::uint8_t {
  kNone = 0,
  kRelocalized = 1,  ///< observations determine the pose again, mostly by a unique match
  kLoopClosed = 2,   ///< a return to a known place corrected the path
  kAbsolute = 3,     ///< an absolute measurement corrected it
  kCorrected = 4,    ///< any other correction beyond 3 σ
  kGap = 5           ///< first pose after a time without poses: no frame arrived, or no localizer ran
};
const char* toString(PoseEvent event);

struct PoseEstimate {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  bool valid = false;
  LocalizationState state = LocalizationState::kUnlocated;
  PoseEvent event = PoseEvent::kNone;
  double correction_sigmas = 0.0;  ///< size of the correction of an event, in σ of the prediction
  SourceSet used;                  ///< what the pose rests on, at this frame
  SourceSet rejected;              ///< what has measured something that contradicts the rest
  /// Frame of map_from_base. Empty: `map`. Else the robot's own frame, named after the robot.
  std::string frame;
  Pose2 map_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< (x, y, θ) of the right perturbation
  /// Reference of the covariance. Poses with the same number have the same reference. 0: `map` as configured.
  /// Where the configuration does not fix `map`, the number changes whenever another reference fixes it.
  std::uint32_t datum = 0;
  std::vector<Sighting> sightings;  ///< which tracks of this robot are which robots
  /// Calibration error of the robot's camera, reported where it is significant: the first four entries of a
  /// CameraError (camera_error.h). Zero where the calibration holds.
  Eigen::Vector4d camera_error = Eigen::Vector4d::Zero();
};

enum class MeasurementKind : std::uint8_t {
  kAbsolutePose = 0,  ///< `to` in map: x, y, θ
  kRelativePose = 1,  ///< `to` in `from`: x, y, θ
  kRangeBearing = 2,  ///< range (m) and bearing (rad) of `to`, seen from `from`
  kPosition = 3,      ///< `to` in map: x, y
};

/// A measured quantity, never an estimate. So no information is counted twice.
struct Measurement {
  std::string source;  ///< e.g. "ceiling/c1"
  std::uint32_t sequence = 0;
  MeasurementKind kind = MeasurementKind::kAbsolutePose;
  std::string from, to;
  TimeNs acquired_ns = 0;  ///< time of `to`
  TimeNs from_ns = 0;      ///< time of `from` (relative and range-bearing kinds)
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

/// Relative pose to another place.
struct PlaceLink {
  bool closes_loop = false;  ///< otherwise: to the place before
  std::string robot;         ///< the other place
  std::uint32_t index = 0;
  Pose2 this_from_other;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of the right perturbation
};

/// A node of the topological map (Fernández et al. 2011 §IV.A).
struct Place {
  std::string robot;
  std::uint32_t index = 0;  ///< of the robot's places, from 0
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  std::string frame;  ///< as in PoseEstimate
  Pose2 frame_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of the right perturbation
  bool metric = true;  ///< false: nothing determines the scale; lengths are in arbitrary units
  SignatureFormat format;
  StoredSignature signature;
  std::vector<PlaceLink> links;
};

enum class AlignmentStatus : std::uint8_t {
  kAnchored = 0,  ///< an initial pose, a ceiling camera or a surveyed landmark defines the robot's frame
  kMatched = 1,   ///< shared places or sightings determine how the robot's frame lies in map
  kRefused = 2,   ///< what looked alike contradicts what both have seen
  kUndecided = 3  ///< too little is shared, or several relations fit
};
const char* toString(AlignmentStatus status);

/// How a robot's own frame relates to `map`.
struct Alignment {
  std::string robot;
  TimeNs acquired_ns = 0;  ///< of the evidence
  AlignmentStatus status = AlignmentStatus::kUndecided;
  std::string frame;     ///< of the robot's poses from now on, as in PoseEstimate
  std::string reason;    ///< in words, at most 128 bytes
  double score = 0.0;    ///< 0 … 1; anchored: 1
  Pose2 map_from_frame;  ///< matched: the relation
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< of its right perturbation
};

/// Body of a robot on the floor. Exactly one of radius_m > 0 or a footprint with ≥ 3 vertices is given.
struct RobotBody {
  double radius_m = 0.0;
  Polygon footprint_m;  ///< base_link, CCW
  double height_m = 0.0;
  double wheel_separation_m = 0.0;

  /// Outline in base_link. A round body is approximated by a 48-gon.
  Polygon outline() const;
};

}  // namespace omnifleet
