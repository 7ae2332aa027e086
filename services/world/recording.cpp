#include "world/recording.h"

#include <map>
#include <memory>

#include "dataset/writer.h"
#include "synthetic/laser_scanner.h"
#include "synthetic/renderer.h"
#include "world/drivers.h"

namespace omnifleet::world {
namespace {

struct CameraTrack {
  synthetic::Renderer renderer;
  dataset::ImageStreamWriter writer;
  cv::Mat image;
};

std::vector<std::unique_ptr<CameraTrack>> openCameras(const synthetic::Arena& arena,
                                                      const RecordingOptions& options,
                                                      const std::string& folder) {
  std::vector<std::unique_ptr<CameraTrack>> cameras;
  for (const synthetic::ArenaCamera& camera : arena.cameras) {
    if (!(camera.robot.empty() ? options.ceiling : options.cameras)) continue;
    cameras.push_back(std::make_unique<CameraTrack>(
        CameraTrack{synthetic::Renderer(arena, camera.id, options.seed),
                    dataset::ImageStreamWriter(folder, camera.id, camera.model, options.extension),
                    {}}));
  }
  return cameras;
}

struct LaserTrack {
  synthetic::LaserScanner scanner;
  dataset::LaserWriter writer;
};

std::vector<LaserTrack> openLasers(const synthetic::Arena& arena, std::uint32_t seed,
                                   const std::string& folder) {
  std::vector<LaserTrack> lasers;
  if (!arena.laser) return lasers;
  for (const synthetic::ArenaRobot& robot : arena.robots) {
    if (!robot.has("laser")) continue;
    lasers.push_back({synthetic::LaserScanner(arena, robot.name, seed),
                      dataset::LaserWriter(folder, robot.name, arena.laser->sensor)});
  }
  return lasers;
}

void writeDescription(const synthetic::Arena& arena, const std::string& folder) {
  std::vector<dataset::RobotRecording> robots;
  for (const synthetic::ArenaRobot& robot : arena.robots) {
    dataset::RobotRecording recording;
    recording.name = robot.name;
    if (robot.initial_pose_known) recording.initial_pose = robot.initial_map_from_base;
    recording.body = robot.body;
    robots.push_back(recording);
  }
  dataset::writeDatasetYaml(folder, robots);
  if (arena.markers) dataset::writeMarkers(folder, *arena.markers);
}

}  // namespace

RecordingReport record(const synthetic::Arena& arena, const RecordingOptions& options,
                       const std::string& folder, const std::function<void(int, int)>& progress) {
  World world(arena, options.world, options.seed);
  Drivers drivers(world);
  writeDescription(arena, folder);
  auto cameras = openCameras(arena, options, folder);
  auto lasers = openLasers(arena, options.seed, folder);
  std::map<std::size_t, dataset::WheelsWriter> wheels;  // by robot
  for (std::size_t i = 0; i < arena.robots.size(); ++i)
    if (arena.robots[i].has("wheels")) wheels.emplace(i, dataset::WheelsWriter(folder, arena.robots[i].name));
  std::vector<std::vector<dataset::StampedPose>> truth(arena.robots.size());

  RecordingReport report;
  while (true) {
    const World::State state = world.now();
    for (auto& camera : cameras) {
      camera->renderer.render(state.frame, state.map_from_bases, camera->image);
      camera->writer.write(state.time_ns, camera->image);
    }
    for (LaserTrack& laser : lasers)
      laser.writer.write(laser.scanner.scan(state.frame, state.map_from_bases));
    const World::Driven& driven = world.step(drivers.commands(world));
    for (std::size_t i = 0; i < truth.size(); ++i)
      truth[i].push_back({state.time_ns, state.map_from_bases[i]});
    for (auto& [robot, writer] : wheels)
      for (const dataset::WheelRow& row : driven.wheels[robot]) writer.write(row);
    report.collisions.insert(report.collisions.end(), driven.collisions.begin(), driven.collisions.end());
    report.frames = state.frame + 1;
    report.arrived = drivers.arrived();
    if (progress) progress(report.frames, arena.frames());
    if (report.arrived || report.frames >= arena.frames()) break;
  }
  for (std::size_t i = 0; i < truth.size(); ++i) {
    dataset::writeTruthTrajectory(folder, arena.robots[i].name, truth[i]);
  }
  const double end_s = static_cast<double>(report.frames - 1) / arena.rate_hz;
  dataset::writeTruthScene(folder, arena.truthScene(end_s));
  dataset::writeTruthRoom(folder, arena.truthRoom());
  return report;
}

}  // namespace omnifleet::world
