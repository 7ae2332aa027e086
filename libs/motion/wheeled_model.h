#pragma once

#include "geometry/pose2.h"

namespace omnifleet::motion {

/// Speeds of the two wheels over the floor, m/s.
struct WheelSpeeds {
  double left_mps = 0.0, right_mps = 0.0;
};

/// Speed of base_link (the middle of the axle) along its x axis and about z.
struct Twist {
  double forward_mps = 0.0, turn_radps = 0.0;
};

/// How equation 1 is integrated over a time step.
enum class Integration {
  kArc,    ///< exact for constant wheel speeds: an arc of a circle
  kEuler,  ///< the paper's literal form: a straight step along the heading at its start
};

/// Choi et al. 2014 eq. 1: v = (v_r + v_l)/2, dθ/dt = (v_r − v_l)/L. The paper prints v without its factor
/// 1/2; see docs/methods/local_mapper.md.
Twist twistFromWheels(const WheelSpeeds& wheels, double wheel_separation_m);
WheelSpeeds wheelsFromTwist(const Twist& twist, double wheel_separation_m);

/// previous_from_current after the wheels have rolled the given distances (metres) at a constant ratio (eq.
/// 1).
Pose2 rolled(double left_m, double right_m, double wheel_separation_m, Integration integration);

/// Scales both wheels by the same factor so that neither exceeds the limit; the curvature of the path is
/// kept.
WheelSpeeds limited(const WheelSpeeds& wheels, double max_wheel_mps);

}  // namespace omnifleet::motion
