#include "motion/wheeled_model.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::motion {

Twist twistFromWheels(const WheelSpeeds& wheels, double wheel_separation_m) {
  return {0.5 * (wheels.right_mps + wheels.left_mps),
          (wheels.right_mps - wheels.left_mps) / wheel_separation_m};
}

WheelSpeeds wheelsFromTwist(const Twist& twist, double wheel_separation_m) {
  const double half_difference_mps = 0.5 * twist.turn_radps * wheel_separation_m;
  return {twist.forward_mps - half_difference_mps, twist.forward_mps + half_difference_mps};
}

Pose2 rolled(double left_m, double right_m, double wheel_separation_m, Integration integration) {
  const double length_m = 0.5 * (left_m + right_m);
  const double angle_rad = (right_m - left_m) / wheel_separation_m;
  if (integration == Integration::kEuler) return {length_m, 0.0, wrapAngle(angle_rad)};
  // Chord of the arc: length · sin(α/2)/(α/2), in the direction α/2. The series is used where the quotient
  // loses digits.
  const double half_rad = 0.5 * angle_rad;
  const double sinc =
      std::abs(half_rad) < 1e-4 ? 1.0 - half_rad * half_rad / 6.0 : std::sin(half_rad) / half_rad;
  return {length_m * sinc * std::cos(half_rad), length_m * sinc * std::sin(half_rad), wrapAngle(angle_rad)};
}

WheelSpeeds limited(const WheelSpeeds& wheels, double max_wheel_mps) {
  const double fastest_mps = std::max(std::abs(wheels.left_mps), std::abs(wheels.right_mps));
  if (fastest_mps <= max_wheel_mps) return wheels;
  const double factor = max_wheel_mps / fastest_mps;
  return {wheels.left_mps * factor, wheels.right_mps * factor};
}

}  // namespace omnifleet::motion
