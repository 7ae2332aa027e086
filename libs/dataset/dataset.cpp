#include "dataset/dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

namespace omnifleet::dataset {
namespace {
namespace fs = std::filesystem;

RobotBody readBody(const options::Section& section) {
  RobotBody body;
  const bool round = section.has("radius_m"), polygon = section.has("footprint_m");
  if (round == polygon) section.fail("radius_m", "give exactly one of radius_m and footprint_m");
  section.read("radius_m", body.radius_m, options::kPositive);
  section.read("footprint_m", body.footprint_m);
  if (polygon && body.footprint_m.size() < 3) section.fail("footprint_m", "needs at least 3 vertices");
  if (polygon && signedArea(body.footprint_m) == 0.0) section.fail("footprint_m", "has no area");
  if (signedArea(body.footprint_m) < 0.0) std::reverse(body.footprint_m.begin(), body.footprint_m.end());
  section.require("height_m", body.height_m, options::kPositive);
  section.finish();
  return body;
}

/// @param replayed true if the robot has a folder with data to replay; then other robots see it and `body` is
/// required
RobotRecording readRobot(const options::Section& section, const std::string& name, bool replayed) {
  RobotRecording robot;
  robot.name = name;
  if (section.has("initial_pose")) {
    Eigen::Vector3d pose;
    section.read("initial_pose", pose);
    if (!(pose.head<2>().cwiseAbs().maxCoeff() <= kFarthestInitialPose_m))
      section.fail("initial_pose", fmt::format("x and y must be within ±{:g} m", kFarthestInitialPose_m));
    robot.initial_pose = Pose2{pose.x(), pose.y(), wrapAngle(pose.z())};
  }
  double wheel_separation_m = 0.0;
  section.read("wheel_separation_m", wheel_separation_m, options::kPositive);
  const bool has_body = section.has("body");
  if (!has_body && replayed)
    section.fail(
        "body",
        "is required: radius_m or footprint_m, and height_m; other robots recognise this robot by them");
  if (has_body) robot.body = readBody(section.child("body"));
  robot.body.wheel_separation_m = wheel_separation_m;
  section.finish();
  return robot;
}

/// Checks a robot name, which is also the name of a folder and of a DDS partition.
void checkName(const options::Section& section, const std::string& name) {
  const bool good =
      !name.empty() &&
      name.find_first_not_of("abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ0123456789_-") ==
          std::string::npos;
  if (!good || name == "ceiling" || name == "groundtruth") {
    section.fail(
        name,
        "a robot name may contain only letters, digits, _ and -, and must not be ceiling or groundtruth");
  }
}

std::vector<RobotRecording> readRobots(const std::string& path) {
  const options::Section section = options::Section::load(path);
  std::string format = "omnifleet-dataset";
  int version = 1;
  section.require("format", format, std::vector<std::string>{"omnifleet-dataset"});
  section.require("version", version, options::Range{1, 1});
  const options::Section robots = section.child("robots");
  std::vector<RobotRecording> result;
  for (const std::string& name : robots.keys()) {
    checkName(robots, name);
    const bool replayed = fs::is_directory(fs::path(path).parent_path() / name);
    result.push_back(readRobot(robots.child(name), name, replayed));
  }
  if (result.empty()) section.fail("robots", "must name at least one robot");
  section.finish();
  std::sort(result.begin(), result.end(), [](const auto& a, const auto& b) { return a.name < b.name; });
  return result;
}

void readStreams(const std::string& folder, RobotRecording& robot, std::vector<std::string>& warnings) {
  const fs::path base = fs::path(folder) / robot.name;
  if (!fs::is_directory(base)) return;
  for (const char* name : {"fisheye", "front"}) {
    if (!fs::exists(base / name)) continue;
    auto& stream = name == std::string("front") ? robot.front : robot.fisheye;
    stream = readImageStream(folder, robot.name + "/" + name, warnings);
  }
  if (const auto path = base / "wheels" / "data.csv"; fs::exists(path)) {
    robot.wheels = readWheels(path.string(), warnings);
    if (!(robot.body.wheel_separation_m > 0.0))
      throw options::Error(fmt::format(
          "{}/dataset.yaml: robots.{}.wheel_separation_m: is required, because {} contains wheel speeds",
          folder, robot.name, path.string()));
  }
  if (const auto path = base / "observations.csv"; fs::exists(path)) {
    robot.observations = readObservations(path.string(), robot.name, warnings);
  }
  if (const auto path = base / "laser" / "data.csv"; fs::exists(path))
    robot.laser = readLaser(path.string(), warnings);
  if (const auto path = base / "laser" / "sensor.yaml"; fs::exists(path)) {
    robot.laser_sensor = LaserSensor::load(path.string());
    if (!fs::exists(base / "laser" / "data.csv"))
      throw options::Error(fmt::format("{}: is missing; {} describes a laser, so its scans are required",
                                       (base / "laser" / "data.csv").string(), path.string()));
  }
}

/// Warns about robots without a folder, unless ceiling cameras locate them by their markers. A recording that
/// contains only ground truth has no such folder, so it gives no warning.
void warnAboutMissingFolders(Dataset& dataset) {
  const auto folder = [&](const RobotRecording& robot) { return fs::path(dataset.folder) / robot.name; };
  const auto has = [&](const RobotRecording& robot) { return fs::is_directory(folder(robot)); };
  if (std::none_of(dataset.robots.begin(), dataset.robots.end(), has)) return;
  for (const RobotRecording& robot : dataset.robots) {
    const bool is_marked = dataset.markers && dataset.markers->robots.count(robot.name) > 0;
    if (!has(robot) && !(is_marked && !dataset.ceiling.empty()))
      dataset.warnings.push_back(fmt::format(
          "{}/dataset.yaml: robots.{}: folder {} does not exist; nothing is replayed for this robot",
          dataset.folder, robot.name, folder(robot).string()));
  }
}

std::vector<ImageStream> readCeiling(const std::string& folder, std::vector<std::string>& warnings) {
  std::vector<std::string> names;
  const fs::path base = fs::path(folder) / "ceiling";
  if (!fs::is_directory(base)) return {};
  for (const fs::directory_entry& entry : fs::directory_iterator(base)) {
    if (entry.is_directory()) names.push_back("ceiling/" + entry.path().filename().string());
  }
  std::sort(names.begin(), names.end());
  std::vector<ImageStream> streams;
  for (const std::string& name : names) streams.push_back(readImageStream(folder, name, warnings));
  return streams;
}

}  // namespace

Dataset Dataset::open(const std::string& folder) {
  if (!fs::is_directory(folder)) {
    throw options::Error(
        fmt::format("{}: no such folder; give the folder that contains dataset.yaml", folder));
  }
  if (!fs::exists(fs::path(folder) / "dataset.yaml")) {
    throw options::Error(fmt::format("{}/dataset.yaml: is missing; this folder is not a dataset", folder));
  }
  Dataset dataset;
  dataset.folder = folder;
  dataset.robots = readRobots((fs::path(folder) / "dataset.yaml").string());
  for (RobotRecording& robot : dataset.robots) readStreams(folder, robot, dataset.warnings);
  dataset.ceiling = readCeiling(folder, dataset.warnings);
  const fs::path markers = fs::path(folder) / "ceiling" / "markers.yaml";
  if (fs::exists(markers))
    dataset.markers = MarkerSet::load(markers.string());
  else if (!dataset.ceiling.empty())
    dataset.warnings.push_back(
        fmt::format("{}: is missing; the ceiling cameras locate no robot", markers.string()));
  warnAboutMissingFolders(dataset);
  const fs::path landmarks = fs::path(folder) / "landmarks.yaml";
  if (fs::exists(landmarks)) dataset.landmarks = readLandmarks(landmarks.string());
  return dataset;
}

const RobotRecording* Dataset::findRobot(const std::string& name) const {
  for (const RobotRecording& robot : robots) {
    if (robot.name == name) return &robot;
  }
  return nullptr;
}

const ImageStream* Dataset::findStream(const std::string& name) const {
  for (const RobotRecording& robot : robots) {
    if (robot.fisheye && robot.fisheye->name == name) return &*robot.fisheye;
    if (robot.front && robot.front->name == name) return &*robot.front;
  }
  for (const ImageStream& stream : ceiling) {
    if (stream.name == name) return &stream;
  }
  return nullptr;
}

}  // namespace omnifleet::dataset
