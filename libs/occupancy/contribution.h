#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::occupancy {

// The only inputs of the map (topics map/contribution and map/keyframe_pose), in integers, so that every
// machine computes the same map. Suffix `_dmm`: tenths of a millimetre; `_dmrad`: tenths of a milliradian.

struct PointDmm {
  std::int32_t x_dmm = 0, y_dmm = 0;
  friend bool operator==(const PointDmm& a, const PointDmm& b) {
    return a.x_dmm == b.x_dmm && a.y_dmm == b.y_dmm;
  }
};

constexpr double kDmmPerMetre = 10000.0;  ///< also tenths of a milliradian per radian
inline Eigen::Vector2d metres(const PointDmm& p) {
  return {p.x_dmm / kDmmPerMetre, p.y_dmm / kDmmPerMetre};
}

/// One track as observed in one keyframe, base_link.
struct SupportView {
  std::uint32_t track_id = 0;
  ObjectKind kind = ObjectKind::kUnknown;
  bool truncated = false;
  std::uint16_t solidity_permille = 1000;
  PointDmm position, contact;
  std::vector<std::int32_t> b_dmm;
  std::vector<std::uint16_t> sigma_dmm;  ///< 0: direction is not used
  std::int32_t height_dmm = 0;
  std::uint16_t height_sigma_dmm = 0;  ///< 0: unknown
  std::string name;                    ///< of a landmark that is identified uniquely; else empty
};

/// Point on the surface of an object, base_link; 16 bits reach 3.2 m.
struct SurfacePoint {
  std::uint16_t track = 0;  ///< track id of the object (low 16 bits)
  std::int16_t x_dmm = 0, y_dmm = 0, z_dmm = 0;
  std::uint16_t sigma_dmm = 0;  ///< along the line of sight
};

/// Observations of one keyframe, base_link. It is identified by robot and time and never changed afterwards.
struct Contribution {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  std::int32_t camera_height_dmm = 0;
  PointDmm scan_origin;                  ///< foot of the camera; also the origin of the supports
  std::vector<std::int32_t> range_dmm;   ///< bearing i = 2πi/N; 0: invalid
  std::vector<std::uint16_t> sigma_dmm;  ///< of the range; 0: exact. Empty: all are exact
  std::vector<RayLabel> label;
  std::vector<std::uint16_t> object;  ///< track id (low 16 bits), 0: none
  std::vector<SupportView> views;
  std::vector<SurfacePoint>
      points;  ///< at most kMaxPoints, smallest σ first; none of objects known to be robots
  static constexpr std::size_t kMaxPoints = 64;
};

/// Errors of focal length, height, roll and pitch as in PoseEstimate::camera_error, in millionths.
using CameraErrorPpm = std::array<std::int32_t, 4>;
Eigen::Vector4d cameraErrorOf(const CameraErrorPpm& millionths);

/// Pose of the robot's contribution of that time. The highest (term, revision) wins.
struct KeyframePose {
  std::string robot;
  TimeNs acquired_ns = 0;
  std::uint32_t sequence = 0;
  std::uint32_t term = 0, revision = 0;
  bool valid = false;
  std::string frame;  ///< of the pose, as in PoseEstimate: empty for `map`
  PointDmm position;
  std::int32_t theta_dmrad = 0;
  /// σ of the position (largest axis) and of theta; at most 65535.
  std::uint16_t sigma_dmm = 0, sigma_dmrad = 0;
  std::vector<Sighting> sightings;
  CameraErrorPpm camera_error{};  ///< of the robot's camera; the value in its latest valid pose applies

  Pose2 mapFromBase() const;
};

/// Quantize. `rays` replaces the scan of `objects` (see map_rays.h). Values that are not finite or exceed
/// 1500 m become invalid rays, unusable directions or an invalid pose.
Contribution makeContribution(const Objects& objects, const Scan& rays);
inline Contribution makeContribution(const Objects& objects) {
  return makeContribution(objects, objects.scan);
}
KeyframePose makeKeyframePose(const PoseEstimate& pose, std::uint32_t term = 0, std::uint32_t revision = 0);

/// Supports of a view in metres. Unusable directions get σ 0.
SupportFunction supportsOf(const SupportView& view);

/// Machine-independent bytes (little endian) of all members, and their FNV-1a 64 digest.
std::string canonicalBytes(const Contribution& contribution);
std::string canonicalBytes(const KeyframePose& pose);
std::uint64_t digest(const std::string& bytes);

}  // namespace omnifleet::occupancy
