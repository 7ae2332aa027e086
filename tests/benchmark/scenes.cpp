#include "tests/benchmark/scenes.h"

#include <algorithm>

#include "synthetic/renderer.h"
#include "world/drivers.h"

namespace omnifleet::bench {
namespace {

constexpr std::uint32_t kSeed = 1;

}  // namespace

std::string benchmarkFile(const std::string& name) {
  return std::string(OMNIFLEET_SOURCE_DIR) + "/tests/benchmark/" + name;
}

Recording::Recording(const std::string& arena_file, int skipped, int frames, bool all_robots, bool ceiling)
    : arena_(synthetic::Arena::load(arena_file)) {
  world::World world(arena_, world::World::Options::read(arena_.world), kSeed);
  world::Drivers drivers(world);
  std::vector<synthetic::Renderer> renderers;
  for (const synthetic::ArenaRobot& robot : arena_.robots) {
    robots_.push_back(robot.name);
    if (all_robots || renderers.empty()) renderers.emplace_back(arena_, robot.name + "/fisheye", kSeed);
  }
  std::unique_ptr<synthetic::Renderer> above;
  if (ceiling) above = std::make_unique<synthetic::Renderer>(arena_, "ceiling/c1", kSeed);
  images_.resize(renderers.size());
  wheels_.resize(robots_.size());
  truth_.resize(robots_.size());
  for (int k = 0; k < skipped; ++k) world.step(drivers.commands(world));
  for (int k = 0; k < frames; ++k) {
    const world::World::State state = world.now();
    for (std::size_t r = 0; r < renderers.size(); ++r) {
      images_[r].emplace_back();
      renderers[r].render(state.frame, state.map_from_bases, images_[r].back());
    }
    if (above) above->render(state.frame, state.map_from_bases, ceiling_.emplace_back());
    const world::World::Driven& driven = world.step(drivers.commands(world));
    for (std::size_t r = 0; r < robots_.size(); ++r) {
      truth_[r].push_back(state.map_from_bases[r]);
      wheels_[r].push_back(driven.wheels[r].front());
    }
  }
}

int Recording::frameOf(int step) const {
  const int phase = step % round();
  return std::min(phase, round() - phase);
}

dataset::WheelRow Recording::wheels(std::size_t robot, int step) const {
  const int here = frameOf(step), next = frameOf(step + 1);
  dataset::WheelRow row = wheels_[robot][static_cast<std::size_t>(std::min(here, next))];
  row.time_ns = time(step);
  if (next < here) {
    row.left_mps = -row.left_mps;
    row.right_mps = -row.right_mps;
  }
  return row;
}

Pose2 Recording::truth(std::size_t robot, int step) const {
  return truth_[robot][static_cast<std::size_t>(frameOf(step))];
}

std::vector<PoseEstimate> Recording::poses(int step) const {
  std::vector<PoseEstimate> all(robots_.size());
  for (std::size_t r = 0; r < robots_.size(); ++r) {
    all[r].robot = robots_[r];
    all[r].acquired_ns = time(step);
    all[r].sequence = static_cast<std::uint32_t>(step);
    all[r].valid = true;
    all[r].map_from_base = truth(r, step);
    all[r].covariance = Eigen::Vector3d(1e-6, 1e-6, 1e-6).asDiagonal();
  }
  return all;
}

const Recording& Scenes::typical() {
  constexpr int kDepartureFrames = 15;  // until all robots drive
  if (!typical_) {
    typical_ =
        std::make_unique<Recording>(benchmarkFile("typical.yaml"), kDepartureFrames, frames_, true, true);
  }
  return *typical_;
}

const Recording& Scenes::cluttered() {
  if (!cluttered_) {
    cluttered_ = std::make_unique<Recording>(benchmarkFile("cluttered.yaml"), 5, frames_, false, false);
  }
  return *cluttered_;
}

}  // namespace omnifleet::bench
