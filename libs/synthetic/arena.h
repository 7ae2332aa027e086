#pragma once

#include <map>
#include <optional>
#include <set>
#include <string>
#include <vector>

#include "dataset/laser.h"
#include "lens/camera.h"
#include "observation/observation.h"
#include "synthetic/scene.h"

namespace omnifleet::synthetic {

/// A simulated robot: a cylinder, or a prism over its footprint, with its markers on top.
struct ArenaRobot {
  std::string name;
  RobotBody body;  ///< default of Choi et al. 2014 §II: radius 15 cm, height 30 cm
  Pose2 initial_map_from_base;
  Rgb rgb{38, 38, 42};
  double texture = 0.5;  ///< 1, amplitude of the surface variation
  std::vector<Eigen::Vector2d>
      waypoints_m;  ///< map; the robot follows them by itself if the arena has no formation
  std::vector<Eigen::Vector3d> speeds;  ///< open-loop commands, rows (time s, left m/s, right m/s)
  std::vector<Eigen::Vector2d> tour_m;  ///< map; without a formation the robot visits these places in turn,
                                        ///< again and again, in straight lines without avoidance
  double tour_mps = 0.18;               ///< m/s, speed on the tour
  std::optional<std::set<std::string>> sensors;  ///< of kSensors; nothing: every rig of the arena and wheels
  bool initial_pose_known = true;  ///< false: the pose is not part of the fleet and of recordings

  bool has(const std::string& sensor) const { return !sensors || sensors->count(sensor) > 0; }
};

/// What a robot of an arena may carry.
inline const std::vector<std::string> kSensors{"fisheye", "front", "laser", "wheels"};

struct ArenaCamera {
  std::string id;     ///< "r1/fisheye", "r1/front", "ceiling/c1"
  std::string robot;  ///< empty: ceiling camera
  lens::CameraModel model;
};

/// The laser scanner of every robot that has the sensor `laser`.
struct ArenaLaser {
  dataset::LaserSensor sensor;
  int beams = 360;         ///< beams per scan
  double fov_deg = 360.0;  ///< centred on the zero direction of the scanner; beams divide it evenly, 360°
                           ///< without a double beam

  static ArenaLaser read(const options::Section& section);
};

/// From `at_s` on, an obstacle moves to a new pose, in a straight line at constant speed within `within_s`.
struct ObstacleMove {
  int obstacle = 0;  ///< index in `solids`
  double at_s = 0.0, within_s = 0.0;
  Pose2 map_from_solid;
};

/// Content of an arena file config/arenas/*.yaml; config/arenas/README.md documents the keys.
struct Arena {
  std::string name;
  double rate_hz = 5.0;      ///< frames per second of every camera
  double duration_s = 20.0;  ///< maximum duration of a run
  TimeNs start_ns = 1'000'000'000'000;
  Floor floor;
  Light light;
  ImageFormation image;
  std::vector<Solid> solids;         ///< obstacles in file order, then walls
  std::vector<ObstacleMove> moves;   ///< sorted by time
  std::vector<ArenaRobot> robots;    ///< sorted by name
  std::vector<ArenaCamera> cameras;  ///< sorted by id
  std::optional<ArenaLaser> laser;   ///< one scan per frame
  std::optional<dataset::MarkerSet> markers;
  bool has_formation = false;  ///< false: each robot drives by its own waypoints or speeds
  options::Section world;      ///< options of world::World::Options
  options::Section formation;  ///< options of formation::Formation::Options
  options::Section random;     ///< options of randomised()

  /// Throws options::Error that names file, line, key and bound.
  static Arena load(const std::string& path);
  static Arena read(const options::Section& section);

  TimeNs periodNs() const;
  TimeNs frameTimeNs(int frame) const { return start_ns + frame * periodNs(); }
  int frames() const;
  int robotIndex(const std::string& robot_name) const;  ///< index in `robots`; −1 if there is no such robot
  const ArenaRobot& robot(const std::string& robot_name) const;   ///< throws options::Error
  const ArenaCamera& camera(const std::string& camera_id) const;  ///< throws options::Error
  /// Pose of a solid after its moves; time since the start of the run.
  Pose2 solidAt(int solid, double time_s) const;
  /// Ground truth for scene.geojson: the obstacles (without walls) at a time.
  std::vector<dataset::MapObject> truthScene(double time_s) const;
  /// Ground truth for room.geojson: the inner side of the walls around the floor. Empty without walls.
  Polygon truthRoom() const;
};

/// Camera of Choi et al. 2014 §II: equidistant fisheye, 1280×960, 185°. It looks down from a tube over the
/// centre of the body, half a metre above the floor. The image circle fills the height of the image.
lens::CameraModel paperFisheye();

/// Varies obstacles, colours, light and initial poses of an arena by the seed (synthetic/randomised.h).
Arena randomised(const Arena& arena, std::uint32_t seed);

}  // namespace omnifleet::synthetic
