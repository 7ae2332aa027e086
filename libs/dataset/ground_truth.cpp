#include "dataset/ground_truth.h"

#include <algorithm>
#include <filesystem>
#include <stdexcept>

namespace omnifleet::dataset {

GroundTruth GroundTruth::load(const std::string& dataset_folder) {
  namespace fs = std::filesystem;
  const fs::path folder = fs::path(dataset_folder) / "groundtruth";
  if (!fs::is_directory(folder))
    throw std::runtime_error(folder.string() + ": no such folder; the dataset has no ground truth");
  GroundTruth truth;
  for (const fs::directory_entry& entry : fs::directory_iterator(folder)) {
    if (entry.path().extension() != ".tum") continue;
    std::vector<StampedPose>& poses = truth.trajectories[entry.path().stem().string()];
    poses = flat(readTum(entry.path().string()));
    std::stable_sort(poses.begin(), poses.end(),
                     [](const auto& a, const auto& b) { return a.time_ns < b.time_ns; });
  }
  if (fs::exists(folder / "scene.geojson")) {
    truth.scene = readObjects((folder / "scene.geojson").string(), &truth.warnings);
    truth.has_scene = true;
  }
  const fs::path room = folder / "room.geojson";
  if (fs::exists(room)) {
    const std::vector<MapObject> outlines = readObjects(room.string());
    if (outlines.size() != 1) throw std::runtime_error(room.string() + ": must contain exactly one polygon");
    truth.room = outlines.front().outline_m;
  }
  return truth;
}

}  // namespace omnifleet::dataset
