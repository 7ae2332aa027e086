#pragma once

#include <optional>
#include <string>
#include <vector>

#include "dataset/merge_file.h"
#include "evaluation/cell_metrics.h"
#include "evaluation/classification.h"
#include "evaluation/consistency.h"
#include "evaluation/free_space.h"
#include "evaluation/localization_metrics.h"
#include "evaluation/map_metrics.h"
#include "evaluation/solid_metrics.h"
#include "evaluation/trajectory_metrics.h"

namespace omnifleet::evaluate {

struct RobotReport {
  std::string name;
  bool has_trajectory = false;   ///< OUT/trajectories/<robot>.tum exists
  int frames = 0;                ///< number of frames in the recording; 0 if unknown
  evaluation::PathMetrics path;  ///< without alignment, except for Frame::kFree
  std::optional<evaluation::PathMetrics>
      dead_reckoning;  ///< from wheel odometry only, starting with the true pose of the first estimate
  evaluation::Statistics ate_m;   ///< evo's APE, translation, SE(2) alignment
  evaluation::RelativeError rpe;  ///< evo's RPE, delta 1 frame
  std::optional<evaluation::Consistency>
      consistency;  ///< if OUT/covariances/<robot>.csv exists and its poses have truth
  std::optional<evaluation::LocalizationMetrics>
      localization;                               ///< if OUT/localization/<robot>.csv exists and has rows
  std::optional<double> shape_difference;         ///< μ of the trajectory, in whatever frame it is
  std::optional<double> places_shape_difference;  ///< μ of OUT/places/<robot>.g2o
  int places = 0;                                 ///< number of its nodes that have truth
  std::optional<dataset::RobotMerge> merge;       ///< if OUT/merge.json lists the robot
  /// Of a robot in its own frame: OUT/maps/<robot>/trajectories/<robot>.tum, after rigid alignment (Umeyama).
  std::optional<evaluation::PathMetrics> own_frame;

  bool isInItsOwnFrame() const { return merge && merge->isInItsOwnFrame(); }
};

/// Landmarks with the same name in scene and map; metres.
struct LandmarkReport {
  int truths = 0, found = 0;
  double mean_m = 0.0, max_m = 0.0;  ///< distance of the centroids
};

struct Report {
  std::vector<dataset::MapObject> truth, objects;
  std::optional<evaluation::MapMetrics> map;  ///< if the recording has scene.geojson
  std::optional<evaluation::SolidMetrics>
      space;  ///< voxels of map.bt above the floor, if the scene has heights
  std::optional<evaluation::FreeSpaceMetrics>
      free_space;  ///< free cells of map.yaml, if the recording has scene.geojson
  std::optional<evaluation::CellMetrics> cells;  ///< cells of map.yaml at the true faces; likewise
  std::optional<LandmarkReport> landmarks;  ///< if the scene has named objects; these do not count in `map`
  std::optional<Pose2> truth_from_map;      ///< alignment applied to the run before the comparison
  std::vector<RobotReport> robots;
  std::optional<evaluation::Consistency> consistency;  ///< of all robots that have covariances
  std::optional<evaluation::KindMetrics> kinds;        ///< if the run has tracks/<robot>.csv
  std::vector<std::string> warnings;
};

enum class Frame {
  kSame,  ///< the map frame of the run is the frame of the truth
  kFree,  ///< one rigid motion aligns the whole run, all robots and the map, to the truth
};

/// Compares the run in `out` with the truth of a recording. Throws options::Error when the recording or its
/// truth cannot be read or `out` is not a folder, std::runtime_error when a result of the run is missing or
/// damaged.
Report evaluateRun(const std::string& out, const std::string& dataset_folder, Frame frame = Frame::kSame);

/// Table for users: lengths in cm, angles in degrees.
std::string table(const Report& report);

/// Text of metrics.json: metres and radians, null for missing values.
std::string metricsJson(const Report& report);

}  // namespace omnifleet::evaluate
