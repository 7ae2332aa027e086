#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evaluation/classification.h"
#include "evaluation/consistency.h"
#include "evaluation/free_space.h"
#include "evaluation/map_metrics.h"
#include "evaluation/solid_metrics.h"
#include "evaluation/trajectory_metrics.h"

namespace omnifleet::evaluate {

struct RobotReport {
  std::string name;
  bool has_trajectory = false;   ///< OUT/trajectories/<robot>.tum is there
  int frames = 0;                ///< frames the recording has for it; 0 where that is unknown
  evaluation::PathMetrics path;  ///< unaligned, unless asked for
  std::optional<evaluation::PathMetrics>
      dead_reckoning;             ///< of the wheels alone, from the first estimate's truth
  evaluation::Statistics ate_m;   ///< evo's APE, translation, SE(2) alignment
  evaluation::RelativeError rpe;  ///< evo's RPE, delta 1 frame
  std::optional<evaluation::Consistency>
      consistency;  ///< where OUT/covariances/<robot>.csv is there and poses have truth
  std::optional<double> shape_difference;  ///< μ of OUT/places/<robot>.g2o
  int places = 0;                          ///< its nodes with truth
};

/// Landmarks that have a name on both sides, matched by it; metres.
struct LandmarkReport {
  int truths = 0, found = 0;
  double mean_m = 0.0, max_m = 0.0;  ///< distance of the centroids
};

struct Report {
  std::vector<dataset::MapObject> truth, objects;
  std::optional<evaluation::MapMetrics> map;  ///< where the recording has scene.geojson
  std::optional<evaluation::SolidMetrics>
      space;  ///< voxels of map.bt above the floor, where the scene has heights
  std::optional<evaluation::FreeSpaceMetrics> free_space;  ///< of map.yaml, where there is scene.geojson
  std::optional<LandmarkReport> landmarks;  ///< where the scene names any; they do not count in `map`
  std::optional<Pose2> truth_from_map;      ///< applied to the run before comparing
  std::vector<RobotReport> robots;
  std::optional<evaluation::Consistency> consistency;  ///< of all robots that have one
  std::optional<evaluation::KindMetrics> kinds;        ///< where the run has tracks/<robot>.csv
  std::vector<std::string> warnings;
};

enum class Frame {
  kSame,  ///< the run's map frame is the truth's
  kFree,  ///< one rigid motion of the whole run, the same for all robots and the map, brings it to the truth
};

/// Compares the run in `out` with the truth of a recording. Throws options::Error where the recording or its
/// truth cannot be read or `out` is no folder, std::runtime_error where a result of the run is missing or
/// damaged.
Report evaluateRun(const std::string& out, const std::string& dataset_folder, Frame frame = Frame::kSame);

/// For people: lengths in cm, angles in degrees.
std::string table(const Report& report);

/// Text of metrics.json: metres and radians, null for what does not exist.
std::string metricsJson(const Report& report);

}  // namespace omnifleet::evaluate
