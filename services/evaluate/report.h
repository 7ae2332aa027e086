#pragma once

#include <optional>
#include <string>
#include <vector>

#include "evaluation/classification.h"
#include "evaluation/map_metrics.h"
#include "evaluation/trajectory_metrics.h"

namespace omnifleet::evaluate {

struct RobotReport {
  std::string name;
  bool has_trajectory = false;             ///< OUT/trajectories/<robot>.tum is there
  int frames = 0;                          ///< frames the recording has for it; 0 where that is unknown
  evaluation::PathMetrics path;            ///< unaligned
  evaluation::Statistics ate_m;            ///< evo's APE, translation, SE(2) alignment
  evaluation::RelativeError rpe;           ///< evo's RPE, delta 1 frame
  std::optional<double> shape_difference;  ///< μ of OUT/places/<robot>.g2o
  int places = 0;                          ///< its nodes with truth
};

struct Report {
  std::vector<dataset::MapObject> truth, objects;
  std::optional<evaluation::MapMetrics> map;  ///< where the recording has scene.geojson
  std::vector<RobotReport> robots;
  std::optional<evaluation::KindMetrics> kinds;  ///< where the run has tracks/<robot>.csv
  std::vector<std::string> warnings;
};

/// Compares the run in `out` with the truth of a recording. Throws options::Error where the recording or its
/// truth cannot be read or `out` is no folder, std::runtime_error where a result of the run is missing or
/// damaged.
Report evaluateRun(const std::string& out, const std::string& dataset_folder);

/// For people: lengths in cm, angles in degrees.
std::string table(const Report& report);

/// Text of metrics.json: metres and radians, null for what does not exist.
std::string metricsJson(const Report& report);

}  // namespace omnifleet::evaluate
