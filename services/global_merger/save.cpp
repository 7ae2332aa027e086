#include "global_merger/save.h"

#include <exception>
#include <filesystem>
#include <functional>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <system_error>

#include "dataset/atomic_file.h"
#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"
#include "global_merger/map_picture.h"

namespace omnifleet::global_merger {
namespace {

namespace fs = std::filesystem;

struct RobotFiles {
  RobotFiles(const std::string& folder, const std::string& robot)
      : trajectory(folder + "/trajectories/" + robot + ".tum"),
        covariances(folder + "/covariances/" + robot + ".csv"),
        localization(folder + "/localization/" + robot + ".csv") {}
  std::string trajectory, covariances, localization;
};

void writePicture(const std::string& path, const MapPicture& picture) {
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", drawMap(picture), png))
    throw std::runtime_error(path + ": the picture cannot be encoded");
  dataset::writeAtomic(path, {reinterpret_cast<const char*>(png.data()), png.size()});
}

void removeFile(const std::string& file, std::vector<std::string>& problems) {
  std::error_code problem;
  fs::remove(file, problem);
  if (problem) problems.push_back(file + ": cannot be removed: " + problem.message());
}

}  // namespace

std::vector<std::string> saveMap(const Merger& merger, const std::string& folder) {
  std::vector<std::string> problems;
  const auto attempt = [&](const std::function<void()>& write) {
    try {
      write();
    } catch (const std::exception& problem) {
      problems.emplace_back(problem.what());
    }
  };
  const auto& objects = merger.lastOutlines();
  auto grid = merger.grid(objects);
  if (grid.width == 0)
    grid.width = grid.height = 1, grid.cells = {-1};  // nothing known yet: one unknown cell
  const auto rejected = merger.rejectedPlaces();
  attempt([&] { dataset::writeAtomic(folder + "/map.bt", merger.map().octreeBytes(objects)); });
  attempt([&] { dataset::writeMapServer(folder + "/map", grid, merger.frame()); });
  attempt([&] { dataset::writeObjects(folder + "/objects.geojson", objects, rejected, merger.frame()); });
  std::map<std::string, std::vector<dataset::StampedPose>> paths;
  for (const auto& [robot, trajectory] : merger.trajectories()) {
    const RobotFiles files(folder, robot);
    attempt([&, &poses = trajectory.poses] { dataset::writeTum(files.trajectory, poses); });
    attempt([&, &rows = trajectory.covariances] { dataset::writeCovariances(files.covariances, rows); });
    paths[robot] = trajectory.poses;
  }
  for (const auto& [robot, rows] : merger.localization()) {
    const RobotFiles files(folder, robot);
    const auto frame = merger.frameOf(robot);
    if (!frame || *frame == merger.frame() || paths.count(robot) > 0) {
      attempt([&, &states = rows] { dataset::writeLocalization(files.localization, states); });
    } else {
      removeFile(files.localization, problems);
    }
  }
  attempt([&] {
    writePicture(folder + "/map.png", {grid, objects, paths, merger.bodies(), rejected, merger.frame()});
  });
  return problems;
}

std::vector<std::string> removeMap(const std::string& robot, const std::string& folder) {
  std::vector<std::string> problems;
  const RobotFiles files(folder, robot);
  for (const std::string& file : {files.trajectory, files.covariances, files.localization})
    removeFile(file, problems);
  for (const char* name : {"/map.bt", "/map.pgm", "/map.yaml", "/map.png", "/objects.geojson"})
    removeFile(folder + name, problems);
  std::error_code has_other_files;
  for (const char* name : {"/trajectories", "/covariances", "/localization", ""})
    fs::remove(folder + name, has_other_files);
  return problems;
}

}  // namespace omnifleet::global_merger
