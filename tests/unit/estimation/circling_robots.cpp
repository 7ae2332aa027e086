#include "circling_robots.h"

#include <cmath>
#include <utility>

namespace omnifleet::estimation::testing {
namespace {

constexpr double kCircleStep_m = 0.06, kCircleTurn_rad = 0.08, kWheelError = 0.03,
                 kScanNoise = 0.003;  // 1/m, of scans
constexpr double kFrom_rad[] = {0.0, 2.5, 4.2};

/// A circle of 0.75 m in the room. @param from_rad angle of its first pose
std::vector<Pose2> circle(double from_rad, int frames) {
  const Pose2 centre{0.2, -0.45, 0.0};
  std::vector<Pose2> path{centre * Pose2{0.75 * std::sin(from_rad), -0.75 * std::cos(from_rad), from_rad}};
  for (int i = 1; i < frames; ++i) path.push_back(path.back() * Pose2{kCircleStep_m, 0.0, kCircleTurn_rad});
  return path;
}

}  // namespace

CirclingRobots::CirclingRobots(std::vector<scan::testing::Scene> rooms, int frames, std::uint32_t seed)
    : rooms_(std::move(rooms)), random_(seed) {
  for (std::size_t robot = 0; robot < rooms_.size(); ++robot)
    paths_.push_back(circle(kFrom_rad[robot], frames));
}

std::vector<RobotSetup> CirclingRobots::setups() const {
  std::vector<RobotSetup> all(paths_.size());
  for (std::size_t robot = 0; robot < all.size(); ++robot) {
    all[robot].name = name(robot);
    all[robot].body.radius_m = 0.1;
    all[robot].body.wheel_separation_m = 0.2;
  }
  all[0].initial_pose = paths_[0].front();
  return all;
}

Objects CirclingRobots::frame(std::size_t robot, std::size_t i) {
  const std::vector<Pose2>& path = paths_[robot];
  Objects frame;
  frame.robot = name(robot);
  frame.acquired_ns = time(i);
  frame.sequence = static_cast<std::uint32_t>(i);
  frame.boundary = rooms_[robot].scan(path[i], kScanNoise, random_);
  frame.motion.since_ns = frame.acquired_ns - kPeriod_ns;
  frame.motion.valid = i > 0;
  if (i == 0) return frame;
  frame.motion.previous_from_current = path[i - 1].inverse() * path[i];
  frame.motion.previous_from_current.x_m *= 1.0 + kWheelError;
  frame.motion.previous_from_current.theta_rad *= 1.0 - kWheelError;
  frame.motion.covariance = Eigen::Vector3d(1e-5, 1e-5, 1e-5).asDiagonal();
  frame.motion.left_m = frame.motion.right_m = kCircleStep_m;
  return frame;
}

scan::testing::Scene lookAlikeRoom() {
  scan::testing::Scene room = scan::testing::furnishedRoom();
  room.outlines.resize(1);
  room.outlines.push_back({{-2.5, -2.0}, {-1.2, -2.0}, {-1.2, -1.4}, {-2.5, -1.4}});
  room.outlines.push_back({{1.3, 1.3}, {2.5, 1.3}, {2.5, 2.0}, {1.3, 2.0}});
  room.outlines.push_back({{-1.6, 0.2}, {-1.2, 0.2}, {-1.2, 0.7}, {-1.6, 0.7}});
  return room;
}

}  // namespace omnifleet::estimation::testing
