#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "motion/wheeled_model.h"
#include "synthetic/arena.h"

namespace omnifleet::world {

/// The simulated room and robots: true wheeled motion (Choi et al. 2014 eq. 1), actuator limits, collisions
/// and wheel reports. now() is the state at the time of a frame; step() advances to the next frame.
class World {
 public:
  struct Options {
    double max_wheel_mps = 0.6;   ///< m/s, limit of the wheel speed
    double max_wheel_mps2 = 2.0;  ///< m/s², limit of the wheel acceleration
    double scale_sigma = 0.02;  ///< 1, σ of the constant scale error of each wheel's reports, drawn per robot
    double noise = 0.02;        ///< 1, σ of the noise of each report, relative to the speed
    double slip = 0.0;          ///< 1, σ of the true distance per step relative to the rolled distance
    int rows_per_frame = 1;     ///< wheel reports between two frames
    int inner_steps = 20;       ///< integration steps per report
    double command_hold_s = 1.0;  ///< s, live: a robot without a command for longer stops
    bool collisions_stop = true;  ///< a robot stops at an obstacle instead of passing through it

    static Options read(const options::Section& section);
  };

  /// Collision of a robot with an obstacle, a wall or another robot.
  struct Collision {
    TimeNs time_ns = 0;
    std::string robot, with;
    double depth_m = 0.0;
  };

  struct State {
    int frame = 0;
    TimeNs time_ns = 0;
    std::vector<Pose2> map_from_bases;  ///< truth, in the order of arena.robots
  };

  /// Events between now() and the next frame.
  struct Driven {
    std::vector<std::vector<dataset::WheelRow>>
        wheels;                         ///< per robot; the first row has the time of the frame
    std::vector<Collision> collisions;  ///< at most one per pair of robot and obstacle
  };

  World(synthetic::Arena arena, const Options& options, std::uint32_t seed);

  const synthetic::Arena& arena() const { return arena_; }
  const State& now() const { return state_; }
  /// True speed of a robot.
  motion::Twist twist(std::size_t robot) const {
    return motion::twistFromWheels(speeds_[robot], arena_.robots[robot].body.wheel_separation_m);
  }
  /// True at and after the last frame of the arena.
  bool finished() const { return state_.frame + 1 >= arena_.frames(); }

  /// Drives for one frame period. @param commands wheel speeds, one per robot; held for the period, reached
  /// within the limits of the motors. Non-finite commands count as zero. Throws std::runtime_error for a
  /// wrong number of commands.
  const Driven& step(const std::vector<motion::WheelSpeeds>& commands);

 private:
  void driveRow(int row, const std::vector<motion::WheelSpeeds>& commands);
  void driveRobot(std::size_t robot, const motion::WheelSpeeds& command, double dt_s, double time_s);
  /// True when the pose would move the robot deeper into an obstacle. Reports every collision.
  bool collides(std::size_t robot, const Pose2& pose, double time_s, TimeNs time_ns);
  void report(std::size_t robot, const std::string& with, double depth_m, TimeNs time_ns);

  synthetic::Arena arena_;
  Options options_;
  State state_;
  Driven driven_;
  std::vector<motion::WheelSpeeds> speeds_;    ///< true speeds now
  std::vector<motion::WheelSpeeds> rolled_m_;  ///< since the beginning of the row, metres
  std::vector<Eigen::Vector2d> scale_;         ///< reported = true · scale
  std::vector<std::mt19937> noise_;            ///< one stream per robot
};

}  // namespace omnifleet::world
