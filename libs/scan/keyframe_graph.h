#pragma once

#include <Eigen/Core>
#include <Eigen/LU>
#include <Eigen/SparseCholesky>
#include <cstdint>
#include <memory>
#include <vector>

#include "geometry/pose2.h"

namespace omnifleet::scan {

struct KeyframeGraphOptions {
  int iterations = 10;         ///< Gauss–Newton steps, at most
  double robust_sigmas = 3.0;  ///< σ at which a constraint counts half (Cauchy)
  double converged_m = 1e-5;   ///< m; largest step that ends the iteration
};

/// Dependence of a measured relative pose on the errors of the two cameras that it rests on: the pose as
/// measured is true ∘ (by_error · (error − assumed)), first order.
struct CameraDependence {
  using Vector = Eigen::Matrix<double, 8, 1>;
  std::uint32_t from_camera = 0, to_camera = 0;
  Vector assumed = Vector::Zero();  ///< errors that were taken off: of to_camera, then of from_camera
  Eigen::Matrix<double, 3, 8> by_error = Eigen::Matrix<double, 3, 8>::Zero();
  /// What the match itself says of the errors, with its pose eliminated.
  Eigen::Matrix<double, 8, 8> information = Eigen::Matrix<double, 8, 8>::Zero();
  Vector gradient = Vector::Zero();  ///< information · (optimum − assumed)
};

/// What all constraints together say about the errors of the cameras, poses eliminated: quadratic cost
/// ½ (e − at)ᵀ information (e − at) − gradientᵀ (e − at). Four rows per camera.
struct CameraEvidence {
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient, at;
};

/// Least squares over the poses of keyframes: relative poses between pairs (odometry, scan matches, loop
/// closures) and absolute poses (initial poses, ceiling cameras). Keyframes of all robots share one graph.
/// Sparse Cholesky in a fixed order: equal input gives equal bits.
class KeyframeGraph {
 public:
  using Id = std::uint32_t;

  explicit KeyframeGraph(const KeyframeGraphOptions& options = {}) : options_(options) {}

  Id add(const Pose2& map_from_keyframe);
  /// @param from_to pose of `to` in `from` @param covariance of its right perturbation (m, m, rad)
  /// @return index of the constraint
  std::size_t addRelative(Id from, Id to, const Pose2& from_to, const Eigen::Matrix3d& covariance,
                          const CameraDependence* cameras = nullptr);
  void setCovariance(std::size_t constraint, const Eigen::Matrix3d& covariance) {
    constraints_[constraint].information = covariance.inverse();
  }
  /// @param covariance of the right perturbation
  void addAbsolute(Id keyframe, const Pose2& map_from_keyframe, const Eigen::Matrix3d& covariance);

  /// Numbers of another graph's first pose and constraint after append().
  struct Appended {
    Id pose = 0;
    std::size_t constraint = 0;
  };
  /// Adds all poses and constraints of another graph, moved by map_from_other; their numbers grow alike. Its
  /// absolute poses hold in its own frame only and lose their weight. Cameras keep their numbers; the errors
  /// that the constraints there assume are taken over.
  Appended append(const KeyframeGraph& other, const Pose2& map_from_other);

  /// Calibration errors of a camera (focal length, height, roll, pitch; see CameraError) that the next
  /// solution assumes. Cameras count from 0.
  void setCamera(std::uint32_t camera, const Eigen::Vector4d& error);
  /// As of the last solution. Empty without constraints that depend on cameras.
  CameraEvidence cameraEvidence() const;

  /// Solves for all poses. @return largest translation of a keyframe, metres
  double optimise();

  const Pose2& pose(Id keyframe) const { return poses_[keyframe]; }
  std::size_t size() const { return poses_.size(); }
  std::size_t constraints() const { return constraints_.size(); }
  /// Of the right perturbation, as of the last optimise(); the whole graph must be held by some absolute
  /// pose.
  Eigen::Matrix3d covariance(Id keyframe) const;

 private:
  static constexpr Id kMap = 0xffffffffU;  ///< `from` of an absolute pose
  struct Constraint {
    Id from, to;
    Pose2 measured;
    Eigen::Matrix3d information;
    std::shared_ptr<const CameraDependence> cameras;
  };
  /// Measured pose, corrected for the errors that are assumed now.
  Pose2 corrected(const Constraint& constraint) const;
  CameraDependence::Vector errorsOf(const CameraDependence& cameras) const;
  using Solver = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>;
  struct System;

  KeyframeGraphOptions options_;
  std::vector<Pose2> poses_;
  std::vector<Constraint> constraints_;
  std::vector<Eigen::Vector4d> cameras_;
  std::shared_ptr<const Solver> solver_;  ///< of the last optimise()
};

}  // namespace omnifleet::scan
