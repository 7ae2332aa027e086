#pragma once

#include <map>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"

namespace omnifleet::dataset {

/// The truth of a recording. Only `evaluate` (and tests) may include this header; a test greps for others.
struct GroundTruth {
  std::map<std::string, std::vector<StampedPose>> trajectories;  ///< robot → map_from_base over time
  std::vector<MapObject> scene;
  bool has_scene = false;
  Polygon room;  ///< inner side of its walls; empty: not known

  /// Reads groundtruth/<robot>.tum, scene.geojson and room.geojson, each optional. Throws std::runtime_error
  /// when the folder is missing or a file is malformed.
  static GroundTruth load(const std::string& dataset_folder);
};

}  // namespace omnifleet::dataset
