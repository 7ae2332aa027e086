#pragma once

// What the stages tell each other, as plain C++ (the IDL types on the wire map one to one onto these; see
// services/adapters). Frames: base_link is on the floor under the wheel axle's middle, x forward, y left, z
// up.

#include <Eigen/Core>
#include <cstdint>
#include <string>
#include <vector>

#include "geometry/polygon.h"
#include "geometry/pose2.h"
#include "observation/support_function.h"

namespace omnifleet {

using TimeNs = std::int64_t;  ///< Acquisition time on the data clock, nanoseconds.

/// Why a sample is not usable; kOk is the only valid state. Every stage passes it on, one sample per frame.
enum class FrameState : std::uint8_t {
  kOk = 0,
  kMissing,     ///< listed but not there
  kUnreadable,  ///< there but not decodable
  kWrongSize,   ///< other size than its calibration
  kEmpty,       ///< no pixels
  kNonFinite,   ///< a NaN or infinity in a number that must not be one
  kDark,        ///< black or covered
  kOverexposed,
  kTorn,  ///< overwritten while being read
  kOutOfOrder,
};
const char* toString(FrameState state);

/// The robot's motion since its previous frame: wheels, corrected by flow or compass where they help.
struct Motion {
  bool valid = false;                                        ///< false on the first frame and across a gap
  TimeNs since_ns = 0;                                       ///< acquisition time of the previous frame
  Pose2 previous_from_current;                               ///< base_link(previous) ← base_link(current)
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< of the right perturbation (x, y, θ), m, rad
  double left_m = 0.0, right_m = 0.0;  ///< distance rolled by each wheel, metres (0 when there are no wheels)
  bool refuted = false;  ///< the wheels told another motion, which what stands around refutes: this is by that,
                         ///< or not known
};

/// A point of a thing's surface in space.
struct ScenePoint {
  Eigen::Vector3f point_m = Eigen::Vector3f::Zero();  ///< base_link, z its height over the floor
  float sigma_m = 0.0f;  ///< along the line of sight, where it is least certain; ≤ 0: the point is not known
};

/// One feature point followed by Lucas–Kanade, corrected to the floor (Choi eq. 6–7 with the camera's own
/// lens).
struct FlowVector {
  Eigen::Vector2f from_px, to_px;  ///< previous and current frame
  Eigen::Vector2f from_m, to_m;    ///< on the floor, each in its own frame's base_link
  Eigen::Vector2f residual_m;  ///< to_m minus from_m moved by the robot's own motion: zero for floor points
  ScenePoint point;            ///< where it is, from its displacement since it was first followed
};

/// One labelled region of one frame.
struct ObjectObservation {
  std::uint16_t label = 0;
  int rect_x_px = 0, rect_y_px = 0, rect_width_px = 0, rect_height_px = 0;
  Polygon hull_m;  ///< convex hull of the silhouette on the floor, base_link, CCW
  Eigen::Vector2d centroid_m =
      Eigen::Vector2d::Zero();  ///< Choi eq. 8 over the region's pixels, on the floor
  Eigen::Vector2d contact_m =
      Eigen::Vector2d::Zero();  ///< nearest point of the inner edge: contact with the floor
  SupportFunction supports;
  double solidity = 1.0;   ///< area of the silhouette ÷ area of its hull (floor); < 0.94 means merged
  bool truncated = false;  ///< touches the edge of the valid image or the self mask
  double height_m = 0.0, height_sigma_m = 0.0;  ///< from the vectors' lengths; σ ≤ 0 where unknown
  std::vector<FlowVector> vectors;
};

enum class RayLabel : std::uint8_t {
  kInvalid = 0,   ///< nothing known in this direction
  kFloorEnd = 1,  ///< floor seen up to the range, nothing hit
  kObstacle = 2,
  kRobot = 3,
  kUnknown = 4,  ///< something stands there, not yet told which
  kUndecided =
      5  ///< local_map only: floor seen up to the range; beyond it floor, or a thing that looks like it
};

/// Range per bearing from the foot of the camera, in base_link: bearing_i = 2πi/N.
struct Scan {
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();  ///< foot of the camera (or laser) in base_link
  /// Metres from `origin`: nearer, the own body hides the floor (in some direction at least), and of what
  /// stands there only that is seen which stands out beyond. 0: nothing is hidden.
  double blind_m = 0.0;
  std::vector<float> range_m;
  std::vector<float> sigma_m;
  std::vector<RayLabel> label;
  std::vector<std::uint16_t> object;  ///< label (local_map) or track id (objects) that was hit; 0: none
};

struct LocalMap {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  FrameState state = FrameState::kOk;
  double camera_height_m = 0.0;  ///< H of the prism model; the camera's height over the floor
  Motion motion;
  std::vector<ObjectObservation> objects;
  Scan scan;
};

enum class ObjectKind : std::uint8_t { kUnknown = 0, kObstacle = 1, kRobot = 2 };
const char* toString(ObjectKind kind);

/// One object followed by one robot, in that robot's base_link at the frame's time.
struct Track {
  std::uint32_t id = 0;  ///< unique per robot, never reused in a run
  ObjectKind kind = ObjectKind::kUnknown;
  double kind_probability = 0.0;  ///< of `kind`
  /// Observed in this very frame; else predicted, without supports. So may be who stands where it says that
  /// it does, where something undecided is seen.
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
  std::vector<ScenePoint> points;  ///< of its surface, told in this frame
  std::string name;                ///< of a landmark that can be told from all others; else empty
};

struct Objects {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  FrameState state = FrameState::kOk;
  double camera_height_m = 0.0;
  Motion motion;
  std::vector<Track> tracks;
  Scan scan;  ///< labels settled; `object` is the track id
};

struct Sighting {
  std::uint32_t track_id = 0;
  std::string robot;
};

struct PoseEstimate {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  bool valid = false;
  Pose2 map_from_base;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();  ///< x, y, θ; right perturbation
  /// What the covariance is against: poses of one number against the same thing. 0: `map` as it was told.
  /// Where nobody tells where `map` is, another number each time something else holds it.
  std::uint32_t datum = 0;
  std::vector<Sighting> sightings;  ///< which of this robot's tracks are which robots
  /// How the robot's camera errs as far as it must be believed: the first four of a CameraError
  /// (camera_error.h); zero where the calibration holds.
  Eigen::Vector4d camera_error = Eigen::Vector4d::Zero();
};

enum class MeasurementKind : std::uint8_t {
  kAbsolutePose = 0,  ///< `to` in map: x, y, θ
  kRelativePose = 1,  ///< `to` in `from`: x, y, θ
  kRangeBearing = 2,  ///< range m, bearing rad of `to` from `from`
  kPosition = 3,      ///< `to` in map: x, y
};

/// Something measured, never an estimate, so that nothing counts twice.
struct Measurement {
  std::string source;  ///< e.g. "ceiling/c1"
  std::uint32_t sequence = 0;
  MeasurementKind kind = MeasurementKind::kAbsolutePose;
  std::string from, to;
  TimeNs acquired_ns = 0;  ///< time of `to`
  TimeNs from_ns = 0;      ///< time of `from` (relative kinds)
  Eigen::Vector3d value = Eigen::Vector3d::Zero();
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Identity();
};

/// Body of a robot as seen on the floor. Exactly one of radius_m > 0 or a footprint of ≥ 3 vertices.
struct RobotBody {
  double radius_m = 0.0;
  Polygon footprint_m;  ///< base_link, CCW
  double height_m = 0.0;
  double wheel_separation_m = 0.0;

  /// Outline in base_link (a 48-gon for a round body).
  Polygon outline() const;
};

}  // namespace omnifleet
