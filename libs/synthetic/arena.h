#pragma once

#include <map>
#include <optional>
#include <string>
#include <vector>

#include "dataset/laser.h"
#include "lens/camera.h"
#include "observation/observation.h"
#include "synthetic/scene.h"

namespace omnifleet::synthetic {

/// A robot as it looks: a cylinder or a prism over its footprint, with its markers on top.
struct ArenaRobot {
  std::string name;
  RobotBody body;  ///< default: Choi et al. 2014 §II: radius 15 cm, height 30 cm
  Pose2 initial_map_from_base;
  Rgb rgb{38, 38, 42};
  double texture = 0.5;                      ///< 1, amplitude of the surface's variation
  std::vector<Eigen::Vector2d> waypoints_m;  ///< map; driven alone where the arena has no formation
  std::vector<Eigen::Vector3d> speeds;       ///< rows (time s, left m/s, right m/s) driven blindly
};

struct ArenaCamera {
  std::string id;     ///< "r1/fisheye", "r1/front", "ceiling/c1"
  std::string robot;  ///< empty: on the ceiling
  lens::CameraModel model;
};

/// The laser that every robot carries.
struct ArenaLaser {
  dataset::LaserSensor sensor;
  int beams = 360;  ///< of one scan
  double fov_deg =
      360.0;  ///< about the scanner's zero direction; beams part it evenly, a whole turn without doubling

  static ArenaLaser read(const options::Section& section);
};

/// From `at_s` on the obstacle moves to a new place, straight and evenly within `within_s`.
struct ObstacleMove {
  int obstacle = 0;  ///< index in `solids`
  double at_s = 0.0, within_s = 0.0;
  Pose2 map_from_solid;
};

/// Everything that config/arenas/*.yaml says (its keys: config/arenas/README.md).
struct Arena {
  std::string name;
  double rate_hz = 5.0;      ///< frames per second of every camera
  double duration_s = 20.0;  ///< longest run
  TimeNs start_ns = 1'000'000'000'000;
  Floor floor;
  Light light;
  ImageFormation image;
  std::vector<Solid> solids;         ///< obstacles in file order, then walls
  std::vector<ObstacleMove> moves;   ///< sorted by time
  std::vector<ArenaRobot> robots;    ///< sorted by name
  std::vector<ArenaCamera> cameras;  ///< sorted by id
  std::optional<ArenaLaser> laser;   ///< scans once per frame
  std::optional<dataset::MarkerSet> markers;
  bool has_formation = false;  ///< else robots drive alone, by their waypoints or speeds
  options::Section world;      ///< for world::World::Options
  options::Section formation;  ///< for formation::Formation::Options
  options::Section random;     ///< for randomised()

  /// Throws options::Error naming file, line, key and bound.
  static Arena load(const std::string& path);
  static Arena read(const options::Section& section);

  TimeNs periodNs() const;
  TimeNs frameTimeNs(int frame) const { return start_ns + frame * periodNs(); }
  int frames() const;
  int robotIndex(const std::string& robot_name) const;            ///< in `robots`; −1: there is none
  const ArenaRobot& robot(const std::string& robot_name) const;   ///< throws options::Error
  const ArenaCamera& camera(const std::string& camera_id) const;  ///< throws options::Error
  /// Where a solid stands, with its moves; time since the start.
  Pose2 solidAt(int solid, double time_s) const;
  /// Truth for scene.geojson: obstacles (no walls) as they stand at a time.
  std::vector<dataset::MapObject> truthScene(double time_s) const;
  /// Truth for room.geojson: the inner side of the walls around the floor; empty where there are none.
  Polygon truthRoom() const;
};

/// The rig of Choi et al. 2014 §II: fisheye 1280×960, 185°, looking down from a tube over the body's middle,
/// half a metre above the floor; equidistant, filling the image's height.
lens::CameraModel paperFisheye();

/// The same arena with obstacles, colours, light and starts of its own for each seed
/// (synthetic/randomised.h).
Arena randomised(const Arena& arena, std::uint32_t seed);

}  // namespace omnifleet::synthetic
