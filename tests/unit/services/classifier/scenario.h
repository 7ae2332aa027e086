#pragma once

// Scenarios for the classifier, and their scores against the truth of the simulator.

#include <functional>
#include <string>

#include "classifier/classifier.h"
#include "tests/unit/tracking/floor_sim.h"

namespace omnifleet::sim {

struct Scenario {
  std::string name;
  int frames = 60;
  std::function<Scene(std::mt19937&)> make;
  /// Sets the wheel speeds of the robots before each step.
  std::function<void(Scene&, int frame, std::mt19937&)> drive = [](Scene&, int, std::mt19937&) {};
  /// True if the local mapper loses the blobs of this body in this frame.
  std::function<bool(std::size_t body, int frame)> lost = [](std::size_t, int) { return false; };
  std::function<void(const Scene&, const Objects&, int frame)> watch = [](const Scene&, const Objects&, int) {
  };
  bool feedback = true;
  std::function<void(std::vector<PoseEstimate>&)> garble = [](std::vector<PoseEstimate>&) {
  };                ///< changes the published poses
  int warm_up = 0;  ///< first frames that are not counted
};

/// Counted per frame and per body that a robot sees, at least partly, within 2 m.
struct Score {
  long robots_right = 0, robots_missed = 0, obstacles_right = 0, obstacles_as_robots = 0, undecided = 0;
  int switches = 0;      ///< changes of a body's track id
  int relabels = 0;      ///< changes of a body's label from one kind to the other
  double error_m = 0.0;  ///< sum over visible tracks alone in their blob
  long errors = 0;
  double slowest_ms = 0.0, total_ms = 0.0;
  long processed = 0;

  double f1() const {
    return 2.0 * robots_right / std::max(1.0, 2.0 * robots_right + robots_missed + obstacles_as_robots);
  }
  double meanError() const { return error_m / std::max(1L, errors); }
  Score& operator+=(const Score& other);
};

/// Runs the classifiers of all robots of the scene.
Score run(const Scenario& scenario, unsigned seed, const classifier::Classifier::Options& options = {});

/// Three robots (radius 15 cm, height 30 cm) and five obstacles of different shapes in 4 × 4 m, at least 25
/// cm apart.
Scene mixedScene(std::mt19937& rng);
/// Three robots and three boxes, so far apart that none hides another: no id may change.
Scene apartScene(std::mt19937& rng);

}  // namespace omnifleet::sim
