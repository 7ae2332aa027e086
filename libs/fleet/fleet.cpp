#include "fleet/fleet.h"

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>

#include "dataset/dataset.h"
#include "fleet/names.h"
#include "fleet/sources.h"
#include "synthetic/randomised.h"

namespace omnifleet::fleet {
namespace {

std::string besideFile(const options::Section& section, const std::string& path) {
  const std::filesystem::path given(path);
  if (given.empty() || given.is_absolute()) return path;
  return (std::filesystem::path(section.file()).parent_path() / given).lexically_normal().string();
}

void readWorld(const options::Section& world, Fleet& fleet) {
  std::string arena;
  bool randomised = false;
  world.require("arena", arena);
  world.read("seed", fleet.seed, {0, 2147483647});
  world.read("randomised", randomised);
  world.read("end_at_rest", fleet.end_at_rest);
  fleet.arena = synthetic::Arena::load(besideFile(world, arena));
  world.read("duration_s", fleet.arena->duration_s, options::kPositive);
  world.finish();
  if (randomised) fleet.arena = synthetic::randomised(*fleet.arena, static_cast<std::uint32_t>(fleet.seed));
}

RobotSpec readRobot(const std::string& name, const options::Section& section) {
  RobotSpec robot;
  robot.name = name;
  if (section.has("initial_pose")) {
    Eigen::Vector3d pose;
    section.read("initial_pose", pose);
    if (!(pose.head<2>().cwiseAbs().maxCoeff() <= dataset::kFarthestInitialPose_m))
      section.fail("initial_pose",
                   fmt::format("x and y must be within ±{:g} m", dataset::kFarthestInitialPose_m));
    robot.initial_pose = Pose2::fromVector(pose);
  }
  const options::Section body = section.child("body");
  body.read("radius_m", robot.body.radius_m, options::kPositive);
  body.read("footprint_m", robot.body.footprint_m);
  body.require("height_m", robot.body.height_m, options::kPositive);
  if ((robot.body.radius_m > 0) == (robot.body.footprint_m.size() >= 3)) {
    section.fail("body", "needs either radius_m or footprint_m with at least three points");
  }
  body.finish();
  section.require("wheel_separation_m", robot.body.wheel_separation_m, options::kPositive);
  section.read("host", robot.host);
  section.read("wheels", robot.has_wheels);
  std::string laser;
  section.read("laser", laser);
  if (!laser.empty()) robot.laser = dataset::LaserSensor::load(besideFile(section, laser));
  section.finish();
  return robot;
}

CameraSpec readCamera(const std::string& id, const options::Section& section) {
  CameraSpec camera;
  camera.id = id;
  const auto slash = id.find('/');
  if (slash == std::string::npos)
    section.fail("", "camera '" + id + "' must be named ROBOT/fisheye, ROBOT/front or ceiling/NAME");
  const std::string owner = id.substr(0, slash), kind = id.substr(slash + 1);
  if (owner == "ceiling") {
    camera.role = CameraRole::kCeiling;
  } else if (kind == "fisheye" || kind == "front") {
    camera.robot = owner;
    camera.role = kind == "front" ? CameraRole::kFront : CameraRole::kFisheye;
  } else {
    section.fail("", "camera '" + id + "' must be named ROBOT/fisheye, ROBOT/front or ceiling/NAME");
  }
  std::string source, sensor;
  section.require("source", source, std::vector<std::string>{"folder", "video", "device"});
  camera.source = source == "folder"  ? CameraSource::kFolder
                  : source == "video" ? CameraSource::kVideo
                                      : CameraSource::kDevice;
  section.require("path", camera.path);
  if (camera.source != CameraSource::kDevice) camera.path = besideFile(section, camera.path);
  section.require("sensor", sensor);
  camera.model = lens::CameraModel::load(besideFile(section, sensor));
  requireAboveFloor(camera, besideFile(section, sensor));
  camera.rate_hz = 10.0;
  section.read("rate_hz", camera.rate_hz, {0.01, 1000.0});
  section.read("host", camera.host);
  section.finish();
  return camera;
}

/// Of a robot or camera that the arena or the dataset describes, the fleet file may only name the machine.
void readHost(const options::Section& section, std::string& host) {
  section.read("host", host);
  section.finish();
}

/// Frames do not leave their machine, so a robot's camera is on the robot's.
void placeCameras(Fleet& fleet) {
  for (CameraSpec& camera : fleet.cameras) {
    for (const RobotSpec& robot : fleet.robots)
      if (camera.host.empty() && robot.name == camera.robot) camera.host = robot.host;
  }
}

/// A camera and the only reader of its frames are on one machine.
void checkCameraHosts(const Fleet& fleet) {
  const std::vector<ProcessSpec> all = processes(fleet);
  const auto hostOf = [&](const std::string& service, const std::string& instance) {
    const auto found = std::find_if(all.begin(), all.end(), [&](const ProcessSpec& process) {
      return process.service == service && process.instance == instance;
    });
    return found == all.end() || found->host.empty() ? std::string("no host") : found->host;
  };
  for (const ProcessSpec& process : all) {
    if (process.service != "camera") continue;
    const CameraSpec& camera = fleet.camera(process.instance);
    const bool is_ceiling = camera.role == CameraRole::kCeiling;
    const std::string service = is_ceiling ? "localizer" : "local_mapper",
                      instance = is_ceiling ? camera.id : camera.robot;
    const std::string camera_host = hostOf("camera", camera.id), reader_host = hostOf(service, instance);
    if (camera_host != reader_host)
      throw options::Error(
          fmt::format("{}: cameras.{}: it is on {}, but {} {}, which reads its frames, is on {}; frames do "
                      "not leave their "
                      "machine, so give both the same host",
                      fleet.file.file(), camera.id, camera_host, service, instance, reader_host));
  }
}

void readOwn(Fleet& fleet) {
  const options::Section robots = fleet.file.child("robots");
  for (const std::string& name : robots.keys()) {
    const auto known = std::find_if(fleet.robots.begin(), fleet.robots.end(),
                                    [&](const RobotSpec& robot) { return robot.name == name; });
    if (known != fleet.robots.end()) {
      readHost(robots.child(name), known->host);
    } else {
      fleet.robots.push_back(readRobot(name, robots.child(name)));
    }
  }
  const options::Section cameras = fleet.file.child("cameras");
  for (const std::string& id : cameras.keys()) {
    const auto known = std::find_if(fleet.cameras.begin(), fleet.cameras.end(),
                                    [&](const CameraSpec& camera) { return camera.id == id; });
    if (known != fleet.cameras.end()) {
      readHost(cameras.child(id), known->host);
      continue;
    }
    fleet.cameras.push_back(readCamera(id, cameras.child(id)));
    const std::string& owner = fleet.cameras.back().robot;
    const auto isOwner = [&](const RobotSpec& robot) { return robot.name == owner; };
    if (!owner.empty() && std::none_of(fleet.robots.begin(), fleet.robots.end(), isOwner))
      cameras.fail(id, "belongs to robot '" + owner + "', which is not in the fleet");
  }
  std::string markers;
  fleet.file.read("markers", markers);
  std::string landmarks;
  fleet.file.read("landmarks", landmarks);
  if (!landmarks.empty()) fleet.landmarks = dataset::readLandmarks(besideFile(fleet.file, landmarks));
  if (!markers.empty()) fleet.markers = dataset::MarkerSet::load(besideFile(fleet.file, markers));
}

NetworkSpec readNetwork(const options::Section& section) {
  NetworkSpec network;
  std::string interface;
  section.read("interface", interface);
  section.read("addresses", network.interfaces);
  if (!interface.empty() && !network.interfaces.empty())
    section.fail("interface", "conflicts with addresses; remove one of the two");
  if (!interface.empty()) network.interfaces = {interface};
  section.read("peers", network.peers);
  if (network.interfaces.empty() && !network.peers.empty())
    section.fail("peers", "needs interface or addresses as well, by which the peers are reached");
  section.finish();
  return network;
}

const std::vector<std::string>& serviceNames() {
  static const std::vector<std::string> kNames{"camera",        "local_mapper", "classifier", "formation",
                                               "global_merger", "localizer",    "world"};
  return kNames;
}

void checkServices(const options::Section& services) {
  for (const std::string& name : services.keys()) {
    if (std::find(serviceNames().begin(), serviceNames().end(), name) == serviceNames().end()) {
      services.fail(name,
                    "is not a service; services are camera, local_mapper, classifier, formation, "
                    "global_merger, localizer, world");
    }
  }
}

/// Camera of a robot; null if it has none of this role.
const CameraSpec* cameraOf(const Fleet& fleet, const std::string& robot_name, CameraRole role) {
  for (const CameraSpec& camera : fleet.cameras) {
    if (camera.robot == robot_name && camera.role == role) return &camera;
  }
  return nullptr;
}

}  // namespace

/// Rejects a fleet without images, scans or observations, whose processes would wait forever.
void checkSensors(const Fleet& fleet) {
  if (!fleet.locatedRobots().empty()) return;
  const std::string problem =
      "no robot has a camera, a laser or observations, and no ceiling camera with markers sees one; "
      "there is nothing to run";
  if (fleet.dataset.empty()) fleet.file.fail("robots", problem);
  throw options::Error(fleet.dataset + "/dataset.yaml: robots: " + problem);
}

Fleet Fleet::load(const std::string& fleet_file, const std::string& dataset_folder,
                  const std::vector<std::string>& overlays) {
  Fleet fleet;
  if (!fleet_file.empty()) fleet.file = options::Section::load(fleet_file);
  for (const std::string& overlay : overlays) fleet.file.overlay(options::Section::load(overlay));
  fleet.file.read("name", fleet.name);
  checkServices(fleet.file.child("services"));
  fleet.dataset = dataset_folder;
  if (fleet.dataset.empty() && fleet.file.has("dataset")) {
    std::string folder;
    fleet.file.read("dataset", folder);
    if (fleet.file.has("world")) fleet.file.fail("world", "conflicts with dataset; remove one of the two");
    fleet.dataset = besideFile(fleet.file, folder);
  } else {
    fleet.file.has("dataset");
  }
  if (!fleet.dataset.empty()) {
    addDataset(fleet);
    fleet.file.has("world");
  } else if (fleet.file.has("world")) {
    readWorld(fleet.file.child("world"), fleet);
    addArena(fleet);
  }
  readOwn(fleet);
  placeCameras(fleet);
  fleet.network = readNetwork(fleet.file.child("network"));
  fleet.file.finish();
  if (fleet.robots.empty())
    throw options::Error(fleet.file.file() + ": robots: a fleet needs at least one robot");
  std::sort(fleet.robots.begin(), fleet.robots.end(),
            [](const auto& a, const auto& b) { return a.name < b.name; });
  std::sort(fleet.cameras.begin(), fleet.cameras.end(),
            [](const auto& a, const auto& b) { return a.id < b.id; });
  checkNames(fleet);
  checkSensors(fleet);
  checkCameraHosts(fleet);
  return fleet;
}

options::Section Fleet::service(const std::string& service_name) const {
  options::Section section;
  if (arena && service_name == "formation") section = arena->formation;
  if (arena && service_name == "world") section = arena->world;
  section.overlay(file.child("services").child(service_name));
  section.has("host");
  return section;
}

const RobotSpec& Fleet::robot(const std::string& robot_name) const {
  for (const RobotSpec& robot : robots) {
    if (robot.name == robot_name) return robot;
  }
  throw options::Error("robot '" + robot_name + "' is not in the fleet");
}

const CameraSpec& Fleet::camera(const std::string& camera_id) const {
  for (const CameraSpec& camera : cameras) {
    if (camera.id == camera_id) return camera;
  }
  throw options::Error("camera '" + camera_id + "' is not in the fleet");
}

const CameraSpec* Fleet::fisheyeOf(const std::string& robot_name) const {
  return cameraOf(*this, robot_name, CameraRole::kFisheye);
}

const CameraSpec* Fleet::frontOf(const std::string& robot_name) const {
  return cameraOf(*this, robot_name, CameraRole::kFront);
}

const CameraSpec* Fleet::mapCameraOf(const std::string& robot_name) const {
  std::string method = "auto";
  file.child("services").child("local_mapper").read("method", method, {"auto", "distance_vector"});
  if (method == "auto") {
    if (const CameraSpec* fisheye = fisheyeOf(robot_name)) return fisheye;
    const auto has_laser = [&](const RobotSpec& robot) { return robot.name == robot_name && robot.laser; };
    if (std::any_of(robots.begin(), robots.end(), has_laser)) return nullptr;
  }
  return frontOf(robot_name);
}

bool Fleet::isRead(const CameraSpec& camera) const {
  if (camera.role == CameraRole::kCeiling) return true;
  const CameraSpec* used = mapCameraOf(camera.robot);
  return used != nullptr && used->id == camera.id;
}

std::map<std::string, lens::Spread> Fleet::lensSpreads() const {
  std::map<std::string, lens::Spread> all;
  for (const CameraSpec& camera : cameras) {
    if (camera.role == CameraRole::kFisheye && isRead(camera))
      all[camera.robot] = lens::Spread::of(lens::Camera(camera.model));
  }
  return all;
}

std::map<std::string, RobotBody> Fleet::bodies() const {
  std::map<std::string, RobotBody> all;
  for (const RobotSpec& robot : robots) all[robot.name] = robot.body;
  return all;
}

bool Fleet::maps(const std::string& robot_name) const {
  const auto has_laser = [&](const RobotSpec& robot) { return robot.name == robot_name && robot.laser; };
  return mapCameraOf(robot_name) != nullptr || std::any_of(robots.begin(), robots.end(), has_laser);
}

std::vector<std::string> Fleet::mappingRobots() const {
  std::vector<std::string> names;
  for (const RobotSpec& robot : robots) {
    if (maps(robot.name)) names.push_back(robot.name);
  }
  return names;
}

std::vector<std::string> Fleet::observingRobots() const {
  std::vector<std::string> names;
  for (const RobotSpec& robot : robots) {
    if (!maps(robot.name) && robot.has_observations) names.push_back(robot.name);
  }
  return names;
}

std::vector<std::string> Fleet::markedRobots() const {
  std::vector<std::string> names;
  if (ceilingCameras().empty()) return names;
  for (const RobotSpec& robot : robots) {
    if (!maps(robot.name) && !robot.has_observations && markers->robots.count(robot.name) > 0)
      names.push_back(robot.name);
  }
  return names;
}

std::vector<std::string> Fleet::locatedRobots() const {
  const std::vector<std::string> marked = markedRobots();
  std::vector<std::string> names;
  for (const RobotSpec& robot : robots) {
    const bool is_marked = std::find(marked.begin(), marked.end(), robot.name) != marked.end();
    if (maps(robot.name) || robot.has_observations || is_marked) names.push_back(robot.name);
  }
  return names;
}

std::vector<std::string> Fleet::replicas() const {
  std::vector<std::string> names;
  for (const RobotSpec& robot : robots) {
    if (maps(robot.name) || robot.has_observations) names.push_back(robot.name);
  }
  const std::vector<std::string> marked = markedRobots();
  if (names.empty() && !marked.empty()) names.push_back(marked.front());
  return names;
}

std::vector<std::string> Fleet::ceilingCameras() const {
  std::vector<std::string> ids;
  for (const CameraSpec& camera : cameras) {
    if (camera.role == CameraRole::kCeiling && markers) ids.push_back(camera.id);
  }
  return ids;
}

bool Fleet::hasFormation() const {
  if (arena && !arena->formation.keys().empty()) return true;
  return dataset.empty() && file.child("services").has("formation");
}

bool Fleet::hasWorld() const {
  return arena || std::any_of(robots.begin(), robots.end(), [this](const RobotSpec& robot) {
           return !dataset.empty() && (robot.has_wheels || robot.has_observations || robot.laser);
         });
}

}  // namespace omnifleet::fleet
