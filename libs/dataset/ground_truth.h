#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"

namespace omnifleet::dataset {

/// Ground truth of a recording. Only `evaluate` and tests may include this header; a test searches for other
/// includes.
struct GroundTruth {
  std::map<std::string, std::vector<StampedPose>> trajectories;  ///< robot → map_from_base over time
  std::vector<MapObject> scene;
  bool has_scene = false;
  std::vector<std::string> warnings;  ///< one line per feature of scene.geojson that has no area
  Polygon room;                       ///< inner side of the walls; empty: unknown

  /// Reads groundtruth/<robot>.tum, scene.geojson and room.geojson, each optional. Throws std::runtime_error
  /// when the folder is missing or a file is malformed.
  static GroundTruth load(const std::string& dataset_folder);
};

}  // namespace omnifleet::dataset
