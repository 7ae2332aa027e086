#pragma once

#include "observation/observation.h"

namespace omnifleet::tracking {

/// What the vectors of one blob say about its motion since the previous frame.
struct VectorMotion {
  bool valid = false;  ///< enough vectors, and the robot's own motion is known
  int count = 0;
  double moving_share = 0.0;  ///< of the vectors that no static point at any height could show
  Eigen::Vector2d mean_m =
      Eigen::Vector2d::Zero();  ///< mean displacement seen by the robot, rotation removed
};

/// A static point at height h shows −t·H/(H−h) on the floor after rotation is removed, t the camera's
/// translation; with t's own −1 taken out, the residual is −t·λ with λ = h/(H−h) ≥ 0. Whatever has a part
/// across t, or goes with t, moves (docs/methods.md, "Robot or obstacle"). `tolerance_m`: noise of one vector
/// on the floor.
VectorMotion vectorMotion(const ObjectObservation& object, const Motion& motion,
                          const Eigen::Vector2d& foot_m, double tolerance_m);

/// Choi's own rule: "motion vectors of the obstacles have a characteristically large magnitude and are in the
/// opposite direction relative to the motion of the robots". Unknown while the robot stands or has too few
/// vectors.
ObjectKind kindByVectors(const VectorMotion& vectors, const Motion& motion);

}  // namespace omnifleet::tracking
