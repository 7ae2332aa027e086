#pragma once

#include <cstdint>
#include <deque>
#include <memory>
#include <random>
#include <string>
#include <vector>

#include "block_arena.h"
#include "formation/formation.h"

namespace omnifleet::formation {

/// Robots with forward cameras in a BlockArena, in two dimensions: wheels with limited acceleration that obey
/// one frame late, scans of 90° with noise and a blind zone ahead, published poses with noise, one frame
/// late.
class RoverSimulator {
 public:
  struct Options {
    double rate_hz = 5.0;
    double view_deg = 90.0;
    int rays = 360;         ///< per turn
    double range_m = 2.5;   ///< of the scan
    double blind_m = 0.30;  ///< nearest visible floor
    double camera_x_m = 0.05;
    double pose_sigma_m = 0.003, pose_sigma_rad = 0.5 * M_PI / 180.0;
    double wheel_noise = 0.02;
    double max_wheel_mps2 = 2.0;
    double unlabelled_robots = 0.3;  ///< share of frames in which robots look like obstacles
    double lost_states = 0.0;        ///< share of the states that do not reach the other robots
  };

  RoverSimulator(const BlockArena& arena, const std::string& formation_yaml, std::uint32_t seed,
                 const Options& options);
  RoverSimulator(const BlockArena& arena, const std::string& formation_yaml, std::uint32_t seed)
      : RoverSimulator(arena, formation_yaml, seed, Options{}) {}

  /// One frame: all robots observe, decide and drive.
  void step();

  double time_s() const { return static_cast<double>(frame_) / options_.rate_hz; }
  const std::vector<Pose2>& poses() const { return poses_; }
  const motion::FormationState& state(std::size_t robot) const { return states_[robot]; }
  Formation& formation(std::size_t robot) { return *formations_[robot]; }
  bool allArrived() const;
  /// Least distance so far between a driving robot and a block, or between two robots; 0 after a collision.
  double leastGap() const { return least_gap_m_; }
  const std::string& name(std::size_t robot) const { return names_[robot]; }

 private:
  Objects observe(std::size_t robot);
  double sigma(double range_m) const;
  void drive();
  double normal() { return std::normal_distribution<double>()(random_); }

  BlockArena arena_;
  Options options_;
  std::mt19937 random_;
  Polygon outline_m_;
  std::vector<std::string> names_;
  std::vector<std::unique_ptr<Formation>> formations_;
  std::vector<Pose2> poses_, before_;
  std::vector<motion::WheelSpeeds> speeds_, commanded_, next_;
  std::vector<motion::FormationState> states_;
  std::vector<PoseEstimate> published_;
  std::vector<motion::FormationState> received_;
  int frame_ = 0;
  double least_gap_m_ = INFINITY;
};

}  // namespace omnifleet::formation
