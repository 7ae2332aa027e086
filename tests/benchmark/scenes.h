#pragma once

#include <memory>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "dataset/dataset.h"
#include "observation/observation.h"
#include "synthetic/arena.h"

namespace omnifleet::bench {

/// A drive through an arena, rendered before any measurement. It is played forward and backward in turn, so
/// that a benchmark may use any number of steps. Step i shows frame frameOf(i); wheel speeds are negated
/// while it runs backward.
class Recording {
 public:
  /// Renders `frames` frames after `skipped` ones. `all_robots` false: only the first robot's camera.
  Recording(const std::string& arena_file, int skipped, int frames, bool all_robots, bool ceiling);

  const synthetic::Arena& arena() const { return arena_; }
  const std::vector<std::string>& robots() const { return robots_; }
  int frameOf(int step) const;
  /// Number of steps after which the recording repeats: forward and backward.
  int round() const { return 2 * (static_cast<int>(truth_.front().size()) - 1); }
  TimeNs time(int step) const { return arena_.start_ns + step * arena_.periodNs(); }
  const cv::Mat3b& image(std::size_t robot, int step) const {
    return images_[robot][static_cast<std::size_t>(frameOf(step))];
  }
  /// Wheel speeds from this step until the next one.
  dataset::WheelRow wheels(std::size_t robot, int step) const;
  Pose2 truth(std::size_t robot, int step) const;
  /// The true poses of a step in the form that the localizer publishes.
  std::vector<PoseEstimate> poses(int step) const;
  const cv::Mat3b& ceiling(int step) const { return ceiling_[static_cast<std::size_t>(frameOf(step))]; }

 private:
  synthetic::Arena arena_;
  std::vector<std::string> robots_;
  std::vector<std::vector<cv::Mat3b>> images_;
  std::vector<std::vector<dataset::WheelRow>> wheels_;
  std::vector<std::vector<Pose2>> truth_;  ///< per frame
  std::vector<cv::Mat3b> ceiling_;
};

/// Recordings that the benchmarks share. Each is rendered at its first use.
class Scenes {
 public:
  explicit Scenes(bool small) : frames_(small ? 4 : 40) {}
  /// Recording::round() of all of them.
  int round() const { return 2 * (frames_ - 1); }
  const Recording& typical();
  const Recording& cluttered();

 private:
  int frames_;
  std::unique_ptr<Recording> typical_, cluttered_;
};

/// Path of a file in tests/benchmark.
std::string benchmarkFile(const std::string& name);

}  // namespace omnifleet::bench
