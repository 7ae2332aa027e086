#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "observation/observation.h"
#include "tests/raycast/free_space.h"

namespace omnifleet::raycast {

inline constexpr double kRobotRadius_m = 0.15, kRobotHeight_m = 0.3, kWheelSeparation_m = 0.26;
inline constexpr TimeNs kBegin_ns = 1'000'000'000'000;  ///< time of the first frame
inline constexpr double kWheelRow_s = 0.1;

/// Seconds from the first frame.
inline double secondsOf(TimeNs time_ns) {
  return 1e-9 * static_cast<double>(time_ns - kBegin_ns);
}

struct DriveFrame {
  TimeNs time_ns = 0;
  std::vector<Pose2> poses;      ///< of each robot
  bool is_first_lifted = false;  ///< the first robot is carried to another place
};

/// Mean wheel speeds (left, right) of each robot from a time on.
struct WheelStep {
  TimeNs time_ns = 0;
  std::vector<Eigen::Vector2d> speed_mps;
};

struct Drive {
  std::vector<DriveFrame> frames;
  std::vector<WheelStep> wheels;  ///< one per kWheelRow_s
};

/// Where robots begin and go. Empty: anywhere.
struct DrivePlan {
  std::vector<Pose2> starts;  ///< of each robot
  /// The next goal of a robot at `pose` that has driven `travelled_m`.
  std::function<Eigen::Vector2d(std::size_t robot, const Pose2& pose, double travelled_m, Random& random)>
      next_goal;
};

/// Robots drive smooth paths between goals. They keep clear of each other. Throws std::runtime_error
/// if they block each other or if there is no place to set the kidnapped robot down.
Drive driveAll(const FurnishedOptions& options, const FreeSpace& space, Random& random,
               const DrivePlan& plan = {});

}  // namespace omnifleet::raycast
