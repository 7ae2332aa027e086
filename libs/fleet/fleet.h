#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/landmarks.h"
#include "dataset/laser.h"
#include "dataset/markers.h"
#include "geometry/pose2.h"
#include "lens/camera.h"
#include "lens/spread.h"
#include "observation/observation.h"
#include "options/options.h"
#include "synthetic/arena.h"

namespace omnifleet::fleet {

enum class CameraRole { kFisheye, kFront, kCeiling };
enum class CameraSource { kDataset, kFolder, kVideo, kDevice, kArena };

struct CameraSpec {
  std::string id;  ///< "r1/fisheye", "r1/front", "ceiling/c1": topic camera/<id> and the folder in a dataset
  std::string robot;  ///< empty for a ceiling camera
  CameraRole role = CameraRole::kFisheye;
  CameraSource source = CameraSource::kDataset;
  std::string path;      ///< folder, video file or device of sources other than a dataset
  double rate_hz = 0.0;  ///< folder: frames per second; arena: rate of the arena file
  lens::CameraModel model;
  std::string host;
};

struct RobotSpec {
  std::string name;
  std::optional<Pose2> initial_pose;  ///< map_from_base
  RobotBody body;
  bool has_wheels = false;                    ///< wheels/odometry is published
  bool has_observations = false;              ///< reports ranges and bearings instead of images
  std::optional<dataset::LaserSensor> laser;  ///< laser is published
  std::string host;
};

/// How the machines of a fleet reach each other.
struct NetworkSpec {
  std::vector<std::string> interfaces;  ///< names, addresses or subnets; empty: loopback only
  std::vector<std::string> peers;       ///< other hosts, for networks without multicast
};

/// Description of a fleet from a fleet file, a dataset or an arena, with option overlays on top.
/// config/fleets/README.md documents the keys of the file.
struct Fleet {
  std::string name = "fleet";
  std::vector<RobotSpec> robots;    ///< sorted by name
  std::vector<CameraSpec> cameras;  ///< sorted by id
  std::optional<dataset::MarkerSet> markers;
  std::vector<dataset::Landmark> landmarks;  ///< surveyed landmarks of the dataset or of the file `landmarks`
  std::string dataset;                       ///< dataset folder; empty unless the run replays one
  std::optional<synthetic::Arena> arena;     ///< only for simulation
  int seed = 1;                              ///< seed of the noise of the arena
  bool end_at_rest =
      true;  ///< arena: the run ends when every robot has been commanded to stop for one second
  NetworkSpec network;
  options::Section file;  ///< fleet file with overlays; contains the options of the services

  /// Loads a fleet file (which may name `dataset:` or `world:`) or, if `fleet_file` is empty, a dataset
  /// folder. Overlays are files of the same form. Throws options::Error.
  static Fleet load(const std::string& fleet_file, const std::string& dataset_folder,
                    const std::vector<std::string>& overlays);

  /// Options of one service under `services: {NAME: …}`, on top of those of the arena (formation, world).
  /// `host` is marked as known, so that the service does not report it.
  options::Section service(const std::string& service_name) const;

  const RobotSpec& robot(const std::string& robot_name) const;   ///< throws options::Error
  const CameraSpec& camera(const std::string& camera_id) const;  ///< throws options::Error
  const CameraSpec* fisheyeOf(const std::string& robot_name) const;
  const CameraSpec* frontOf(const std::string& robot_name) const;
  /// The camera that a robot maps with: the fisheye camera, else, without a laser, the forward camera; with
  /// `services: {local_mapper: {method: distance_vector}}` always the forward camera. Null without one.
  const CameraSpec* mapCameraOf(const std::string& robot_name) const;
  /// False for a robot's camera that it does not map with.
  bool isRead(const CameraSpec& camera) const;
  std::map<std::string, RobotBody> bodies() const;
  /// Radial projection (lens::Spread) of the fisheye lens of each robot that has one.
  std::map<std::string, lens::Spread> lensSpreads() const;

  /// Robots that map with a fisheye camera, a forward camera or a laser. Each has local_mapper, classifier,
  /// global_merger (and formation).
  std::vector<std::string> mappingRobots() const;
  bool maps(const std::string& robot_name) const;  ///< true for a mapping robot
  /// Robots without camera and laser that report ranges and bearings. The localizer publishes their
  /// `objects`; they have a global_merger.
  std::vector<std::string> observingRobots() const;
  /// Robots without sensors that only ceiling cameras locate, by their markers. Each has a pose per frame of
  /// the ceiling cameras that shows it.
  std::vector<std::string> markedRobots() const;
  /// Mapping, observing and marked robots, by name. Each has a pose stream.
  std::vector<std::string> locatedRobots() const;
  /// Robots with a replica of the map (a global_merger): mapping and observing robots. Without any, the first
  /// marked robot, whose replica saves the paths.
  std::vector<std::string> replicas() const;
  /// The replica that saves the map on a machine: the first one there (of all, without a host). Empty: none.
  std::string savingReplica(const std::string& host) const;
  std::vector<std::string> ceilingCameras() const;
  /// The machines that the fleet file names, sorted.
  std::vector<std::string> hosts() const;
  /// The machines whose localizers may estimate the poses, in the order in which they take over: that of the
  /// localizer (services.localizer.host, else the first one), then the others. Empty without machines.
  std::vector<std::string> estimatorHosts() const;
  bool hasFormation() const;  ///< the fleet drives its robots
  bool hasWorld() const;      ///< simulated, or a dataset with wheels, observations or laser
};

/// One process of a run.
struct ProcessSpec {
  std::string service;   ///< name of program and service: camera, local_mapper, …
  std::string instance;  ///< robot or camera; empty for a service of the whole fleet
  std::string host;
  int stage = 0;  ///< stopping order: 0 (sources) stops first
};

/// All processes of the fleet, upstream first. With `host`, only those of that host; a service of the whole
/// fleet that names no host belongs to the first one.
std::vector<ProcessSpec> processes(const Fleet& fleet, const std::string& host = {});

/// Number of readers of a stream within the fleet. In a deterministic run writers wait for this number before
/// they start. `topic` as in the IDL table ("local_map", "camera", …); `instance` is a robot or a camera id.
int expectedReaders(const Fleet& fleet, const std::string& topic, const std::string& instance);

}  // namespace omnifleet::fleet
