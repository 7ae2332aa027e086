#pragma once

#include <Eigen/Core>
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

/// Least squares over the poses of keyframes: relative poses between pairs (odometry, scan matches, loop
/// closures) and absolute poses (initial poses, ceiling cameras). Keyframes of all robots share one graph.
/// Sparse Cholesky in a fixed order: equal input gives equal bits.
class KeyframeGraph {
 public:
  using Id = std::uint32_t;

  explicit KeyframeGraph(const KeyframeGraphOptions& options = {}) : options_(options) {}

  Id add(const Pose2& map_from_keyframe);
  /// @param from_to pose of `to` in `from` @param covariance of its right perturbation (m, m, rad)
  void addRelative(Id from, Id to, const Pose2& from_to, const Eigen::Matrix3d& covariance);
  /// @param covariance of the right perturbation
  void addAbsolute(Id keyframe, const Pose2& map_from_keyframe, const Eigen::Matrix3d& covariance);

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
  };
  using Solver = Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>>;
  struct System;

  KeyframeGraphOptions options_;
  std::vector<Pose2> poses_;
  std::vector<Constraint> constraints_;
  std::shared_ptr<const Solver> solver_;  ///< of the last optimise()
};

}  // namespace omnifleet::scan
