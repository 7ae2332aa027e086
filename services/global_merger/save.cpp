#include "global_merger/save.h"

#include <exception>
#include <functional>
#include <opencv2/imgcodecs.hpp>

#include "dataset/atomic_file.h"
#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"
#include "global_merger/map_picture.h"

namespace omnifleet::global_merger {
namespace {

void writePicture(const std::string& path, const MapPicture& picture) {
  std::vector<unsigned char> png;
  if (!cv::imencode(".png", drawMap(picture), png))
    throw std::runtime_error(path + ": the picture cannot be encoded");
  dataset::writeAtomic(path, {reinterpret_cast<const char*>(png.data()), png.size()});
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
  attempt([&] { dataset::writeAtomic(folder + "/map.bt", merger.map().octreeBytes(objects)); });
  attempt([&] { dataset::writeMapServer(folder + "/map", grid); });
  attempt([&] { dataset::writeObjects(folder + "/objects.geojson", objects, merger.rejectedPlaces()); });
  for (const auto& [robot, path] : merger.trajectories()) {
    attempt([&, &name = robot, &poses = path] {
      dataset::writeTum(folder + "/trajectories/" + name + ".tum", poses);
    });
  }
  for (const auto& [robot, rows] : merger.covariances()) {
    attempt([&, &name = robot, &covariances = rows] {
      dataset::writeCovariances(folder + "/covariances/" + name + ".csv", covariances);
    });
  }
  for (const auto& [robot, rows] : merger.localization()) {
    attempt([&, &name = robot, &localization = rows] {
      dataset::writeLocalization(folder + "/localization/" + name + ".csv", localization);
    });
  }
  attempt([&] {
    writePicture(folder + "/map.png",
                 {grid, objects, merger.trajectories(), merger.bodies(), merger.rejectedPlaces()});
  });
  return problems;
}

}  // namespace omnifleet::global_merger
