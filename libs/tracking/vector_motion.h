#pragma once

#include "observation/observation.h"

namespace omnifleet::tracking {

/// Motion of one blob since the previous frame, from its flow vectors.
struct VectorMotion {
  bool valid = false;  ///< enough vectors, and the robot's own motion is known
  int count = 0;
  double moving_share = 0.0;  ///< share of the vectors that no stationary point at any height can produce
  Eigen::Vector2d mean_m =
      Eigen::Vector2d::Zero();  ///< mean displacement observed by the robot, rotation removed
};

/// A static point at height h moves by −t·H/(H−h) on the floor after the rotation is removed, with t the
/// camera's translation. With t's own −1 removed, the residual is −t·λ, λ = h/(H−h) ≥ 0. A residual across t,
/// or along t, means that the object moves (docs/methods/classifier.md). `tolerance_m`: noise of one vector
/// on the floor, metres.
VectorMotion vectorMotion(const ObjectObservation& object, const Motion& motion,
                          const Eigen::Vector2d& foot_m, double tolerance_m);

/// Choi's rule (2014, §IV.2): "motion vectors of the obstacles have a characteristically large magnitude and
/// are in the opposite direction relative to the motion of the robots". Unknown while the robot stands or has
/// too few vectors.
ObjectKind kindByVectors(const VectorMotion& vectors, const Motion& motion);

}  // namespace omnifleet::tracking
