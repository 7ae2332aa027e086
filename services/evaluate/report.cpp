#include "evaluate/report.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <set>
#include <stdexcept>

#include "appearance/map_files.h"
#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "evaluation/shape.h"
#include "motion/wheel_integrator.h"
#include "occupancy/octree_file.h"

namespace omnifleet::evaluate {
namespace {

namespace fs = std::filesystem;
using dataset::StampedPose;

constexpr TimeNs kMaxGap_ns = 1'000'000'000;

dataset::GroundTruth loadTruth(const std::string& folder) {
  try {
    return dataset::GroundTruth::load(folder);
  } catch (const std::runtime_error& error) {
    throw options::Error(error.what());
  }
}

/// The image stream whose frames have the times of the trajectory.
const dataset::ImageStream* frames(const dataset::RobotRecording* robot) {
  if (!robot) return nullptr;
  if (robot->fisheye) return &*robot->fisheye;
  return robot->front ? &*robot->front : nullptr;
}

/// The nodes of the place graph have the index of their image in data.csv. Throws std::runtime_error if the
/// saved map is cut short or altered.
void comparePlaces(const std::string& path, const dataset::ImageStream& stream,
                   const std::vector<StampedPose>& truth, RobotReport& report) {
  std::vector<Eigen::Vector2d> got, expected;
  for (const Place& place : appearance::loadMap(path).places) {
    for (const dataset::ImageRow& row : stream.rows) {
      Pose2 pose;
      if (row.sequence != place.sequence) continue;
      if (!evaluation::poseAt(truth, row.time_ns, kMaxGap_ns, pose)) continue;
      got.push_back(place.frame_from_base.translation());
      expected.push_back(pose.translation());
    }
  }
  report.places = static_cast<int>(got.size());
  if (got.size() > 1) report.places_shape_difference = evaluation::shapeDifference(got, expected);
}

/// Of an estimate against the truth at its times. Empty with fewer than two points, or if all coincide.
std::optional<double> shapeDifferenceOf(const std::vector<StampedPose>& truth,
                                        const std::vector<StampedPose>& estimate) {
  std::vector<Eigen::Vector2d> got, expected;
  for (const StampedPose& pose : estimate) {
    Pose2 exact;
    if (!evaluation::poseAt(truth, pose.time_ns, kMaxGap_ns, exact)) continue;
    got.push_back(pose.map_from_base.translation());
    expected.push_back(exact.translation());
  }
  const double difference = evaluation::shapeDifference(got, expected);
  if (std::isnan(difference)) return std::nullopt;
  return difference;
}

/// Number of frames; of observation times for a robot without camera; of times of the ceiling cameras for a
/// robot that has only markers.
int expectedPoses(const dataset::RobotRecording* robot, const dataset::Dataset& recording) {
  if (const dataset::ImageStream* stream = frames(robot)) return static_cast<int>(stream->rows.size());
  std::set<TimeNs> times;
  if (robot) {
    for (const auto& row : robot->observations) times.insert(row.time_ns);
    if (times.empty() && recording.markers && recording.markers->robots.count(robot->name) > 0) {
      for (const dataset::ImageStream& camera : recording.ceiling)
        for (const dataset::ImageRow& row : camera.rows) times.insert(row.time_ns);
    }
  }
  return static_cast<int>(times.size());
}

/// Dead reckoning from wheel odometry at the times of the estimates. Starts with the true pose at the first
/// of them.
std::vector<StampedPose> deadReckoning(const dataset::RobotRecording& robot,
                                       const std::vector<StampedPose>& truth,
                                       const std::vector<StampedPose>& estimate) {
  std::vector<StampedPose> path;
  StampedPose at;
  motion::WheelIntegrator::Options options;
  options.hold_limit_s = 1e6;  // a row is valid until the next one
  motion::WheelIntegrator wheels(robot.body.wheel_separation_m, options);
  for (const dataset::WheelRow& row : robot.wheels) wheels.add(row.time_ns, row.left_mps, row.right_mps);
  for (const StampedPose& pose : estimate) {
    if (path.empty()) {
      if (robot.wheels.front().time_ns > pose.time_ns ||
          !evaluation::poseAt(truth, pose.time_ns, kMaxGap_ns, at.map_from_base))
        continue;
      wheels.motionTo(pose.time_ns);
    } else {
      at.map_from_base = at.map_from_base * wheels.motionTo(pose.time_ns).previous_from_current;
    }
    at.time_ns = pose.time_ns;
    path.push_back(at);
  }
  return path;
}

std::vector<StampedPose> readEstimate(const fs::path& out, const std::string& name,
                                      std::vector<std::string>* warnings) {
  const fs::path path = out / "trajectories" / (name + ".tum");
  if (!fs::exists(path)) return {};
  return dataset::flat(dataset::readTum(path.string(), warnings));
}

/// Rejects a run with the trajectory of a robot that the recording does not have: it belongs to another
/// recording.
void rejectForeignRun(const fs::path& out, const std::string& dataset_folder,
                      const dataset::Dataset& recording) {
  if (!fs::is_directory(out / "trajectories")) return;
  std::vector<fs::path> paths;
  for (const auto& entry : fs::directory_iterator(out / "trajectories")) paths.push_back(entry.path());
  std::sort(paths.begin(), paths.end());
  for (const fs::path& path : paths) {
    const std::string name = path.stem().string();
    const bool is_known = std::any_of(recording.robots.begin(), recording.robots.end(),
                                      [&](const auto& robot) { return robot.name == name; });
    if (path.extension() == ".tum" && !is_known) {
      throw std::runtime_error(path.string() + ": " + dataset_folder + " has no robot '" + name +
                               "'; give the recording of this run");
    }
  }
}

/// Pairs of estimate and truth for a rigid alignment in the plane (least squares).
struct AlignmentPairs {
  std::vector<dataset::StampedPose3> from, to;

  void add(const std::vector<StampedPose>& estimate, const std::vector<StampedPose>& truth) {
    for (const StampedPose& pose : estimate) {
      StampedPose exact{pose.time_ns, {}};
      if (!evaluation::poseAt(truth, pose.time_ns, kMaxGap_ns, exact.map_from_base)) continue;
      from.push_back(evaluation::lift(pose));
      to.push_back(evaluation::lift(exact));
    }
  }
  Pose2 truthFromEstimate() const {
    if (from.empty()) return {};
    const auto fit = evaluation::align(from, to, evaluation::Alignment::kSe2, false);
    return {fit.translation.x(), fit.translation.y(), std::atan2(fit.rotation(1, 0), fit.rotation(0, 0))};
  }
};

/// The rigid motion that aligns all trajectories of a run together to the truth.
Pose2 fleetAlignment(const fs::path& out, const dataset::GroundTruth& truth) {
  AlignmentPairs pairs;
  for (const auto& [name, poses] : truth.trajectories) pairs.add(readEstimate(out, name, nullptr), poses);
  return pairs.truthFromEstimate();
}

std::vector<StampedPose> moved(const Pose2& truth_from_estimate, std::vector<StampedPose> poses) {
  for (StampedPose& pose : poses) pose.map_from_base = truth_from_estimate * pose.map_from_base;
  return poses;
}

/// The path of a robot in its own frame.
void compareOwnFrame(const fs::path& out, const std::vector<StampedPose>& truth,
                     std::vector<std::string>& warnings, RobotReport& report) {
  const auto estimate = readEstimate(out / "maps" / report.name, report.name, &warnings);
  if (estimate.empty()) return;
  AlignmentPairs pairs;
  pairs.add(estimate, truth);
  report.shape_difference = shapeDifferenceOf(truth, estimate);
  report.own_frame = evaluation::comparePaths(truth, moved(pairs.truthFromEstimate(), estimate), kMaxGap_ns);
}

/// Moves the named objects out of both lists and compares them.
std::optional<LandmarkReport> compareLandmarks(Report& report) {
  LandmarkReport landmarks;
  for (const dataset::MapObject& object : report.truth) {
    if (object.name.empty()) continue;
    ++landmarks.truths;
    for (const dataset::MapObject& found : report.objects) {
      if (found.name != object.name) continue;
      const double off_m = (found.centroid_m - object.centroid_m).norm();
      ++landmarks.found;
      landmarks.mean_m += off_m;
      landmarks.max_m = std::max(landmarks.max_m, off_m);
    }
  }
  if (landmarks.truths == 0) return std::nullopt;
  landmarks.mean_m /= std::max(1, landmarks.found);
  const auto named = [](const dataset::MapObject& object) { return !object.name.empty(); };
  report.truth.erase(std::remove_if(report.truth.begin(), report.truth.end(), named), report.truth.end());
  report.objects.erase(std::remove_if(report.objects.begin(), report.objects.end(), named),
                       report.objects.end());
  return landmarks;
}

void moveObjects(const Pose2& truth_from_map, std::vector<dataset::MapObject>& objects) {
  for (dataset::MapObject& object : objects) {
    object.centroid_m = truth_from_map * object.centroid_m;
    for (Eigen::Vector2d& vertex : object.outline_m) vertex = truth_from_map * vertex;
  }
}

/// Empty when the run has no covariances.
std::optional<evaluation::EstimatedPath> estimatedPath(const fs::path& out, const std::string& name,
                                                       const std::vector<StampedPose>& truth,
                                                       std::vector<std::string>* warnings) {
  const fs::path path = out / "covariances" / (name + ".csv");
  if (!fs::exists(path)) return std::nullopt;
  return evaluation::EstimatedPath{truth, readEstimate(out, name, nullptr),
                                   dataset::readCovariances(path.string(), warnings), kMaxGap_ns};
}

evaluation::DatumPlaces placesOf(const fs::path& out, const dataset::GroundTruth& truth) {
  std::vector<evaluation::EstimatedPath> fleet;
  for (const auto& [name, poses] : truth.trajectories) {
    if (auto path = estimatedPath(out, name, poses, nullptr)) fleet.push_back(std::move(*path));
  }
  return evaluation::placeData(fleet);
}

/// Empty when the run has no localization states. `estimate` is in the frame of the truth.
std::optional<evaluation::LocalizationMetrics> compareStates(const fs::path& out, const std::string& name,
                                                             const std::vector<StampedPose>& truth,
                                                             const std::vector<StampedPose>& estimate,
                                                             int frame_count,
                                                             std::vector<std::string>& warnings) {
  const fs::path path = out / "localization" / (name + ".csv");
  if (!fs::exists(path)) return std::nullopt;
  const auto rows = dataset::readLocalization(path.string(), &warnings);
  if (rows.empty()) return std::nullopt;
  return evaluation::compareLocalization(rows, truth, estimate, frame_count, kMaxGap_ns);
}

RobotReport compareRobot(const fs::path& out, const dataset::Dataset& recording, const std::string& name,
                         const std::vector<StampedPose>& truth, const Pose2& truth_from_map,
                         const dataset::MergeReport& merge, std::vector<std::string>& warnings) {
  RobotReport report;
  report.name = name;
  const dataset::RobotRecording* robot = recording.findRobot(name);
  const dataset::ImageStream* stream = frames(robot);
  report.frames = expectedPoses(robot, recording);
  report.has_trajectory = fs::exists(out / "trajectories" / (name + ".tum"));
  const std::vector<StampedPose> estimate = moved(truth_from_map, readEstimate(out, name, &warnings));
  if (robot && !robot->wheels.empty() && robot->body.wheel_separation_m > 0.0 && !truth.empty()) {
    report.dead_reckoning =
        evaluation::comparePaths(truth, deadReckoning(*robot, truth, estimate), kMaxGap_ns);
  }
  report.path = evaluation::comparePaths(truth, estimate, kMaxGap_ns);
  report.shape_difference = shapeDifferenceOf(truth, estimate);
  report.localization = compareStates(out, name, truth, estimate, report.frames, warnings);
  const auto pairs = evaluation::associate(evaluation::lift(truth), evaluation::lift(estimate));
  report.ate_m = evaluation::absoluteTrajectoryError(pairs, evaluation::Alignment::kSe2);
  report.rpe = evaluation::relativePoseError(pairs);
  const fs::path places = out / "places" / (name + ".g2o");
  if (stream && fs::exists(places)) comparePlaces(places.string(), *stream, truth, report);
  if (const auto found = merge.find(name); found != merge.end()) report.merge = found->second;
  if (report.isInItsOwnFrame()) compareOwnFrame(out, truth, warnings, report);
  return report;
}

std::optional<evaluation::KindMetrics> compareTracks(const fs::path& out, const dataset::GroundTruth& truth,
                                                     std::vector<std::string>& warnings) {
  std::optional<evaluation::KindMetrics> sum;
  for (const auto& [name, poses] : truth.trajectories) {
    const fs::path path = out / "tracks" / (name + ".csv");
    if (poses.empty() || !fs::exists(path)) continue;
    const auto rows = dataset::readTracks(path.string(), warnings);
    if (!sum) sum.emplace();
    *sum += evaluation::compareKinds(name, rows, truth.trajectories, truth.scene);
  }
  return sum;
}

/// Compares the voxels of the run's map above the floor with the true obstacles. Empty without map.bt or
/// heights in the scene.
std::optional<evaluation::SolidMetrics> compareSpace(const fs::path& map,
                                                     const std::vector<dataset::MapObject>& scene,
                                                     const Pose2& truth_from_map) {
  if (!fs::exists(map)) return std::nullopt;
  auto voxels = occupancy::voxelsAboveFloor(map.string());
  for (Eigen::Vector3d& voxel : voxels) voxel.head<2>() = truth_from_map * Eigen::Vector2d(voxel.head<2>());
  const auto metrics = evaluation::compareSolids(scene, voxels);
  if (metrics.points == 0) return std::nullopt;
  return metrics;
}

/// Optical centre of a camera and the heading of its optical axis, projected to the floor, in base_link.
Pose2 cameraOnFloor(const lens::CameraModel& camera) {
  const Eigen::Vector3d axis = camera.parentFromCamera().linear().col(2);
  return {camera.position_m.x(), camera.position_m.y(), std::atan2(axis.y(), axis.x())};
}

bool hasSensor(const dataset::RobotRecording& robot) {
  return robot.fisheye || robot.front || !robot.laser.empty() || !robot.observations.empty();
}

/// The true robots: their paths, bodies and what their cameras see. A recording without any sensor holds the
/// truth of a simulated run: its robots are taken to see all around. What a robot in its own frame sees is
/// not in the common map and counts as not seen.
std::map<std::string, evaluation::TrueRobot> trueRobots(const dataset::Dataset& recording,
                                                        const dataset::GroundTruth& truth,
                                                        const dataset::MergeReport& merge) {
  std::map<std::string, evaluation::TrueRobot> all;
  const bool is_truth_only = std::none_of(recording.robots.begin(), recording.robots.end(), hasSensor);
  for (const auto& [name, poses] : truth.trajectories) {
    evaluation::TrueRobot& robot = all[name];
    robot.path = poses;
    const dataset::RobotRecording* recorded = recording.findRobot(name);
    if (!recorded) continue;
    if (recorded->body.radius_m > 0.0 || !recorded->body.footprint_m.empty())
      robot.body_m = recorded->body.outline();
    robot.body_height_m = recorded->body.height_m;
    if (recorded->fisheye) {
      robot.base_from_camera = cameraOnFloor(recorded->fisheye->camera);
      robot.camera_height_m = recorded->fisheye->camera.position_m.z();
    }
    if (is_truth_only || recorded->fisheye || !recorded->laser.empty() || !recorded->observations.empty())
      continue;
    robot.half_view_rad = 0.0;
    if (!recorded->front) continue;
    const lens::CameraModel& camera = recorded->front->camera;
    robot.half_view_rad = std::atan(0.5 * camera.image_width_px / camera.focal_px.x());
    robot.base_from_camera = cameraOnFloor(camera);
    robot.camera_height_m = camera.position_m.z();
  }
  for (const auto& [name, row] : merge)
    if (row.isInItsOwnFrame() && all.count(name) > 0) all[name].half_view_rad = 0.0;
  return all;
}

/// Compares the run's grid with the truth. Needs the run's objects in the frame of the truth. Changes nothing
/// without a grid.
void compareGrid(const fs::path& map, const dataset::Dataset& recording, const dataset::GroundTruth& truth,
                 const dataset::MergeReport& merge, Report& report) {
  if (!fs::exists(map)) return;
  const dataset::OccupancyGrid grid = dataset::readMapServer(map.string());
  const Pose2 truth_from_map = report.truth_from_map.value_or(Pose2{});
  report.free_space = evaluation::compareFreeSpace(grid, truth_from_map, truth.scene, truth.room);
  report.cells = evaluation::compareCells(grid, truth_from_map, report.objects, truth.scene, truth.room,
                                          trueRobots(recording, truth, merge));
}

}  // namespace

Report evaluateRun(const std::string& out, const std::string& dataset_folder, Frame frame) {
  if (!fs::is_directory(out)) throw options::Error(out + ": no such folder; give the --out folder of a run");
  const dataset::Dataset recording = dataset::Dataset::open(dataset_folder);
  const dataset::GroundTruth truth = loadTruth(dataset_folder);
  Report report;
  report.warnings = recording.warnings;
  report.warnings.insert(report.warnings.end(), truth.warnings.begin(), truth.warnings.end());
  rejectForeignRun(out, dataset_folder, recording);
  const fs::path merge_file = fs::path(out) / "merge.json";
  const auto merge =
      fs::exists(merge_file) ? dataset::readMerge(merge_file.string()) : dataset::MergeReport{};
  if (frame == Frame::kFree) report.truth_from_map = fleetAlignment(out, truth);
  if (truth.has_scene) {
    const fs::path path = fs::path(out) / "objects.geojson";
    if (!fs::exists(path)) {
      throw std::runtime_error(path.string() + ": not found; the run has not saved its map (see " + out +
                               "/log)");
    }
    report.truth = truth.scene;
    report.objects = dataset::readObjects(path.string());
    moveObjects(report.truth_from_map.value_or(Pose2{}), report.objects);
    report.space =
        compareSpace(fs::path(out) / "map.bt", truth.scene, report.truth_from_map.value_or(Pose2{}));
    compareGrid(fs::path(out) / "map.yaml", recording, truth, merge, report);
    report.landmarks = compareLandmarks(report);
    if (!report.landmarks || !report.truth.empty() || !report.objects.empty())
      report.map = evaluation::compareMaps(report.truth, report.objects, {});
  }
  std::vector<evaluation::EstimatedPath> fleet;
  const auto places = frame == Frame::kFree ? placesOf(out, truth) : evaluation::DatumPlaces{};
  for (const auto& [name, poses] : truth.trajectories) {
    report.robots.push_back(compareRobot(out, recording, name, poses, report.truth_from_map.value_or(Pose2{}),
                                         merge, report.warnings));
    const auto path = estimatedPath(out, name, poses, &report.warnings);
    if (!path) continue;
    const auto consistency = evaluation::checkConsistency(*path, places);
    if (consistency.samples == 0) continue;
    report.robots.back().consistency = consistency;
    fleet.push_back(*path);
  }
  if (!fleet.empty()) report.consistency = evaluation::checkFleet(fleet, places);
  report.kinds = compareTracks(out, truth, report.warnings);
  return report;
}

}  // namespace omnifleet::evaluate
