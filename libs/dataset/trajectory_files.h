#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <string>
#include <vector>

#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::dataset {

struct StampedPose {
  TimeNs time_ns = 0;
  Pose2 map_from_base;
};

/// Covariance of a pose, of the right perturbation (x, y, θ in the robot's own base_link; m, rad).
struct StampedCovariance {
  TimeNs time_ns = 0;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();
  std::uint32_t datum = 0;  ///< reference of the covariance (PoseEstimate::datum)
};

/// What a pose sample of the localizer rests on. Also samples without a pose have a row.
struct StampedLocalization {
  TimeNs time_ns = 0;
  LocalizationState state = LocalizationState::kUnlocated;
  PoseEvent event = PoseEvent::kNone;
  double correction_sigmas = 0.0;      ///< size of the correction of the event, σ of the prediction
  SourceSet used = {}, rejected = {};  ///< as in PoseEstimate
};

inline constexpr std::array kLocalizationStates{LocalizationState::kUnlocated, LocalizationState::kLocalized,
                                                LocalizationState::kOdometryOnly, LocalizationState::kLost,
                                                LocalizationState::kRelocalized};
inline constexpr std::array kPoseEvents{PoseEvent::kNone,     PoseEvent::kRelocalized, PoseEvent::kLoopClosed,
                                        PoseEvent::kAbsolute, PoseEvent::kCorrected,   PoseEvent::kGap};

/// A complete row of a TUM file: `timestamp[s] tx ty tz qx qy qz qw`.
struct StampedPose3 {
  TimeNs time_ns = 0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();

  /// x, y and the heading of the x axis of the body.
  StampedPose flat() const;
};

/// TUM text: times with nine decimals, poses to 1e-9, no comments, so that equal runs give equal bytes.
std::string tumText(const std::vector<StampedPose>& poses);
/// Writes atomically. Throws std::runtime_error.
void writeTum(const std::string& path, const std::vector<StampedPose>& poses);
/// Skips comments (#) and empty lines. Rows that are malformed, non-finite or have a zero quaternion are
/// ignored and, if `warnings` is given, listed there ("FILE:LINE: problem"). Throws std::runtime_error when
/// the file cannot be read.
std::vector<StampedPose3> readTum(const std::string& path, std::vector<std::string>* warnings = nullptr);
std::vector<StampedPose> flat(const std::vector<StampedPose3>& poses);

/// Covariances of a trajectory, which a TUM file cannot contain. One row per pose: "#timestamp [ns],xx
/// [m^2],xy [m^2],xt [m rad],yy [m^2],yt [m rad],tt [rad^2],datum". Writes atomically. Throws
/// std::runtime_error.
void writeCovariances(const std::string& path, const std::vector<StampedCovariance>& rows);
/// Malformed rows are ignored and listed in `warnings`. Throws std::runtime_error when the file cannot be
/// read.
std::vector<StampedCovariance> readCovariances(const std::string& path,
                                               std::vector<std::string>* warnings = nullptr);

/// States, events and sources of a robot's pose samples: "#timestamp [ns],state,event,correction
/// [sigma],used,rejected". State, event and sources by their names (toString); several sources are joined by
/// '+', "none" stands for no source. Writes atomically. Throws std::runtime_error.
void writeLocalization(const std::string& path, const std::vector<StampedLocalization>& rows);
/// Malformed rows, unknown names and corrections outside of 0 to 1e9 σ are ignored and listed in `warnings`.
/// Rows without the two columns of sources, as older versions wrote them, are read with empty sets. Throws
/// std::runtime_error when the file cannot be read.
std::vector<StampedLocalization> readLocalization(const std::string& path,
                                                  std::vector<std::string>* warnings = nullptr);

/// g2o format: VERTEX_SE2 id x y θ; EDGE_SE2 from to x y θ and the upper triangle of the information matrix.
struct G2oVertex {
  int id = 0;
  Pose2 pose;
};
struct G2oEdge {
  int from = 0, to = 0;
  Pose2 from_from_to;
  Eigen::Matrix3d information = Eigen::Matrix3d::Identity();
};
struct G2oGraph {
  std::vector<G2oVertex> vertices;
  std::vector<G2oEdge> edges;
};
void writeG2o(const std::string& path, const G2oGraph& graph);
/// Skips other tags. Throws std::runtime_error that names file and line of a malformed row.
G2oGraph readG2o(const std::string& path);

}  // namespace omnifleet::dataset
