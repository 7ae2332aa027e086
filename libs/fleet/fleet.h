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
  std::string path;      ///< folder, video file or device of the other sources
  double rate_hz = 0.0;  ///< folder: frames per second; arena: as the arena says
  lens::CameraModel model;
  std::string host;
};

struct RobotSpec {
  std::string name;
  std::optional<Pose2> initial_pose;  ///< map_from_base
  RobotBody body;
  bool has_wheels = false;                    ///< someone publishes wheels/odometry
  bool has_observations = false;              ///< range/bearing instead of images
  std::optional<dataset::LaserSensor> laser;  ///< someone publishes laser
  std::string host;
};

/// What a fleet is made of: from a fleet file, a dataset or an arena, with option overlays on top.
/// The file's keys are described in config/fleets/README.md.
struct Fleet {
  std::string name = "fleet";
  std::vector<RobotSpec> robots;    ///< sorted by name
  std::vector<CameraSpec> cameras;  ///< sorted by id
  std::optional<dataset::MarkerSet> markers;
  std::vector<dataset::Landmark> landmarks;  ///< surveyed ones, of the dataset or of the file `landmarks`
  std::string dataset;                       ///< folder; empty unless the run replays one
  std::optional<synthetic::Arena> arena;     ///< only when simulated
  int seed = 1;                              ///< of the arena's noise
  bool end_at_rest = true;  ///< arena: the run is over when every robot has been told to stand for a second
  options::Section file;    ///< fleet file with overlays: options of services

  /// From a fleet file (may name `dataset:` or `world:`), or, where `fleet_file` is empty, from a dataset
  /// folder. Overlays are files of the same form. Throws options::Error.
  static Fleet load(const std::string& fleet_file, const std::string& dataset_folder,
                    const std::vector<std::string>& overlays);

  /// Options of one service, as written under `services: {NAME: …}`, on top of the arena's (formation,
  /// world); `host` is taken out.
  options::Section service(const std::string& service_name) const;

  const RobotSpec& robot(const std::string& robot_name) const;   ///< throws options::Error
  const CameraSpec& camera(const std::string& camera_id) const;  ///< throws options::Error
  const CameraSpec* fisheyeOf(const std::string& robot_name) const;
  std::map<std::string, RobotBody> bodies() const;
  /// How the fisheye lenses of the robots that have one spread angles.
  std::map<std::string, lens::Spread> lensSpreads() const;

  /// Robots that map with a fisheye camera or a laser: they have local_mapper, classifier, global_merger (and
  /// formation).
  std::vector<std::string> mappingRobots() const;
  bool maps(const std::string& robot_name) const;  ///< one of them
  /// Robots with neither that report ranges and bearings instead of images: the localizer makes
  /// their frames, they have a global_merger.
  std::vector<std::string> observingRobots() const;
  /// Both kinds, by name: those that get a pose per frame and hold a replica of the map.
  std::vector<std::string> locatedRobots() const;
  std::vector<std::string> ceilingCameras() const;
  bool hasFormation() const;  ///< robots are driven by this fleet
  bool hasWorld() const;      ///< simulated, or a dataset with wheels, observations or laser
};

/// One process of a run.
struct ProcessSpec {
  std::string service;   ///< program and service name: camera, local_mapper, …
  std::string instance;  ///< robot or camera; empty for one per fleet
  std::string host;
  int stage = 0;  ///< stopping order: 0 (sources) first
};

/// Every process that the fleet needs, upstream first; `host` empty: all of them.
std::vector<ProcessSpec> processes(const Fleet& fleet, const std::string& host = {});

/// How many readers of a stream belong to the fleet; writers wait for so many before a deterministic run
/// starts. `topic` as in the IDL table ("local_map", "camera", …), `instance` robot or camera id.
int expectedReaders(const Fleet& fleet, const std::string& topic, const std::string& instance);

}  // namespace omnifleet::fleet
