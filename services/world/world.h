#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "motion/wheeled_model.h"
#include "synthetic/arena.h"

namespace omnifleet::world {

/// The simulated rooms and robots: true wheeled motion (Choi et al. 2014 eq. 1), actuator limits, collisions,
/// and what the wheels report. Lockstep: `now()` is the world at a frame's time; `step()` drives on to the
/// next frame.
class World {
 public:
  struct Options {
    double max_wheel_mps = 0.6;   ///< m/s, the wheels turn no faster
    double max_wheel_mps2 = 2.0;  ///< m/s², nor change faster
    double scale_sigma = 0.02;  ///< 1, σ of each wheel's lasting scale error in its reports, drawn per robot
    double noise = 0.02;        ///< 1, σ of each report relative to the speed
    double slip = 0.0;          ///< 1, σ of the true path's change per step against what the wheels rolled
    int rows_per_frame = 1;     ///< wheel reports between two frames
    int inner_steps = 20;       ///< integration steps per report
    double command_hold_s = 1.0;  ///< s, live: who hears no command for longer stands
    bool collisions_stop = true;  ///< a robot that touches something stands still instead of passing through

    static Options read(const options::Section& section);
  };

  /// Contact of a robot with an obstacle, a wall or another robot.
  struct Collision {
    TimeNs time_ns = 0;
    std::string robot, with;
    double depth_m = 0.0;
  };

  struct State {
    int frame = 0;
    TimeNs time_ns = 0;
    std::vector<Pose2> map_from_bases;  ///< truth, in the arena's order of robots
  };

  /// What happened from now() on until the next frame.
  struct Driven {
    std::vector<std::vector<dataset::WheelRow>>
        wheels;                         ///< per robot; the first row is at the frame's own time
    std::vector<Collision> collisions;  ///< at most one per robot and thing touched
  };

  World(synthetic::Arena arena, const Options& options, std::uint32_t seed);

  const synthetic::Arena& arena() const { return arena_; }
  const State& now() const { return state_; }
  /// True speed of a robot.
  motion::Twist twist(std::size_t robot) const {
    return motion::twistFromWheels(speeds_[robot], arena_.robots[robot].body.wheel_separation_m);
  }
  /// True at and after the arena's last frame.
  bool finished() const { return state_.frame + 1 >= arena_.frames(); }

  /// Drives one frame period with these wanted wheel speeds, one per robot (held; the motors follow within
  /// their limits). Non-finite commands count as zero. Throws std::runtime_error for another number of
  /// commands.
  const Driven& step(const std::vector<motion::WheelSpeeds>& commands);

 private:
  void driveRow(int row, const std::vector<motion::WheelSpeeds>& commands);
  void driveRobot(std::size_t robot, const motion::WheelSpeeds& command, double dt_s, double time_s);
  /// True where the pose would take the robot deeper into something; every contact is reported.
  bool touches(std::size_t robot, const Pose2& pose, double time_s, TimeNs time_ns);
  void report(std::size_t robot, const std::string& with, double depth_m, TimeNs time_ns);

  synthetic::Arena arena_;
  Options options_;
  State state_;
  Driven driven_;
  std::vector<motion::WheelSpeeds> speeds_;    ///< true, now
  std::vector<motion::WheelSpeeds> rolled_m_;  ///< since the row began, metres
  std::vector<Eigen::Vector2d> scale_;         ///< reported = true · scale
  std::vector<std::mt19937> noise_;            ///< one stream per robot
};

}  // namespace omnifleet::world
