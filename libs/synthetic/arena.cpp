#include "synthetic/arena.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "synthetic/yaml.h"

namespace omnifleet::synthetic {
namespace {

/// Body of Choi et al. 2014 §II: a cylinder, 30 cm high.
RobotBody paperBody() {
  RobotBody body;
  body.radius_m = 0.15;
  body.height_m = 0.30;
  body.wheel_separation_m = 0.26;
  return body;
}

bool isConvex(const Polygon& polygon) {
  const std::size_t n = polygon.size();
  for (std::size_t i = 0; i < n; ++i) {
    const Eigen::Vector2d along = polygon[(i + 1) % n] - polygon[i], next = polygon[(i + 2) % n] - polygon[i];
    if (along.x() * next.y() - along.y() * next.x() < 0.0) return false;
  }
  return true;
}

/// Sensors of a robot; each must be a rig of the arena or its wheels.
void readSensors(const options::Section& section, ArenaRobot& robot) {
  if (!section.has("sensors")) return;
  std::vector<std::string> names;
  section.read("sensors", names);
  robot.sensors.emplace();
  for (const std::string& name : names) {
    if (std::find(kSensors.begin(), kSensors.end(), name) == kSensors.end())
      section.fail("sensors",
                   fmt::format("{} is not a sensor; sensors are {}", name, fmt::join(kSensors, ", ")));
    robot.sensors->insert(name);
  }
}

RobotBody readBody(const options::Section& section) {
  RobotBody body = paperBody();
  section.read("radius_m", body.radius_m, {0.02, 2.0});
  section.read("footprint_m", body.footprint_m);
  section.read("height_m", body.height_m, {0.02, 3.0});
  section.read("wheel_separation_m", body.wheel_separation_m, {0.02, 3.0});
  if (!body.footprint_m.empty()) {
    if (body.footprint_m.size() < 3 || signedArea(body.footprint_m) <= 0.0) {
      section.fail("footprint_m", "needs at least 3 vertices in counter-clockwise order");
    }
    if (!isConvex(body.footprint_m)) section.fail("footprint_m", "must be convex");
    if (section.has("radius_m")) section.fail("radius_m", "give either radius_m or footprint_m, not both");
    body.radius_m = 0.0;
  }
  section.finish();
  return body;
}

/// @param floor_m size of the floor, centred on the origin
ArenaRobot readRobot(const options::Section& section, const std::string& name,
                     const Eigen::Vector2d& floor_m) {
  ArenaRobot robot;
  robot.name = name;
  robot.body = paperBody();
  if (!section.has("initial_pose")) section.fail("initial_pose", "is required: [x m, y m, heading rad]");
  readPose(section, "initial_pose", robot.initial_map_from_base);
  const Eigen::Vector2d initial_m = robot.initial_map_from_base.translation();
  if ((initial_m.cwiseAbs() - 0.5 * floor_m).maxCoeff() > 0.0) {
    section.fail("initial_pose",
                 fmt::format("({:g}, {:g}) is not on the floor; x must be within [{:g}, {:g}], y within "
                             "[{:g}, {:g}] m",
                             initial_m.x(), initial_m.y(), -0.5 * floor_m.x(), 0.5 * floor_m.x(),
                             -0.5 * floor_m.y(), 0.5 * floor_m.y()));
  }
  if (section.has("body")) robot.body = readBody(section.child("body"));
  readRgb(section, "rgb", robot.rgb);
  section.read("texture", robot.texture, {0.0, 0.9});
  section.read("waypoints", robot.waypoints_m);
  readRows(section, "speeds", robot.speeds);
  section.read("tour", robot.tour_m);
  section.read("tour_mps", robot.tour_mps, {0.01, 10.0});
  section.read("initial_pose_known", robot.initial_pose_known);
  readSensors(section, robot);
  if (robot.tour_m.size() == 1) section.fail("tour", "needs at least two places");
  if (!robot.tour_m.empty() && (!robot.waypoints_m.empty() || !robot.speeds.empty()))
    section.fail("tour", "conflicts with waypoints and speeds; give one of them");
  section.finish();
  return robot;
}

/// Adds walls around the floor, along the outer side of its edges.
void addWalls(const options::Section& section, const Eigen::Vector2d& floor_m, std::vector<Solid>& solids) {
  Solid wall;
  wall.wall = true;
  wall.rgb = {120, 110, 95};
  wall.height_m = 0.3;
  double thickness_m = 0.05;
  section.read("height_m", wall.height_m, {0.01, 10.0});
  section.read("thickness_m", thickness_m, {0.005, 2.0});
  readRgb(section, "rgb", wall.rgb);
  section.read("texture", wall.texture, {0.0, 0.9});
  section.finish();
  for (int side = 0; side < 4; ++side) {
    const bool along_x = side % 2 == 0;
    const double sign = side < 2 ? -1.0 : 1.0;
    wall.size_m = along_x ? Eigen::Vector2d(floor_m.x() + 2.0 * thickness_m, thickness_m)
                          : Eigen::Vector2d(thickness_m, floor_m.y());
    const double offset_m = 0.5 * ((along_x ? floor_m.y() : floor_m.x()) + thickness_m) * sign;
    wall.map_from_solid = along_x ? Pose2{0.0, offset_m, 0.0} : Pose2{offset_m, 0.0, 0.0};
    solids.push_back(wall);
  }
}

void readMoves(const options::Section& section, Arena& arena) {
  for (const options::Section& row : section.list("moves")) {
    ObstacleMove move;
    const int last = static_cast<int>(arena.solids.size()) - 1;
    row.require("obstacle", move.obstacle, options::Range{0, static_cast<double>(last)});
    row.require("at_s", move.at_s, options::kNotNegative);
    row.read("within_s", move.within_s, options::kNotNegative);
    if (!row.has("pose")) row.fail("pose", "is required: [x m, y m, angle rad]");
    readPose(row, "pose", move.map_from_solid);
    row.finish();
    arena.moves.push_back(move);
  }
  std::stable_sort(arena.moves.begin(), arena.moves.end(),
                   [](const ObstacleMove& a, const ObstacleMove& b) { return a.at_s < b.at_s; });
}

void readCameras(const options::Section& section, Arena& arena) {
  const options::Section rigs = section.child("rigs");
  const bool fisheye = !section.has("rigs") || rigs.has("fisheye");
  std::optional<lens::CameraModel> front;
  lens::CameraModel eye = paperFisheye();
  if (rigs.has("fisheye")) eye = lens::CameraModel::read(rigs.child("fisheye"));
  if (rigs.has("front")) front = lens::CameraModel::read(rigs.child("front"));
  if (rigs.has("laser")) arena.laser = ArenaLaser::read(rigs.child("laser"));
  rigs.finish();
  for (const ArenaRobot& robot : arena.robots) {
    const auto lacks = [&](const std::string& rig, bool exists) {
      return !exists && robot.sensors && robot.sensors->count(rig) > 0;
    };
    if (lacks("fisheye", fisheye) || lacks("front", front.has_value()) ||
        lacks("laser", arena.laser.has_value()))
      section.child("robots").child(robot.name).fail("sensors", "lists a sensor that is missing in `rigs`");
    if (fisheye && robot.has("fisheye")) arena.cameras.push_back({robot.name + "/fisheye", robot.name, eye});
    if (front && robot.has("front")) arena.cameras.push_back({robot.name + "/front", robot.name, *front});
  }
  const options::Section ceiling = section.child("ceiling");
  for (const std::string& name : ceiling.keys()) {
    arena.cameras.push_back({"ceiling/" + name, "", lens::CameraModel::read(ceiling.child(name))});
  }
  std::sort(arena.cameras.begin(), arena.cameras.end(),
            [](const ArenaCamera& a, const ArenaCamera& b) { return a.id < b.id; });
}

void readFrames(const options::Section& section, Arena& arena) {
  double start_s = 1000.0;
  section.read("rate_hz", arena.rate_hz, {0.1, 100.0});
  section.read("duration_s", arena.duration_s, {0.0, 36000.0});
  section.read("start_s", start_s, {1.0, 4e9});
  section.finish();
  arena.start_ns = static_cast<TimeNs>(std::llround(start_s * 1e3)) * 1'000'000;
}

Pose2 between(const Pose2& from, const Pose2& to, double share) {
  return {from.x_m + share * (to.x_m - from.x_m), from.y_m + share * (to.y_m - from.y_m),
          wrapAngle(from.theta_rad + share * wrapAngle(to.theta_rad - from.theta_rad))};
}

}  // namespace

lens::CameraModel paperFisheye() {
  constexpr double kHalfFieldRad = 92.5 * M_PI / 180.0;
  lens::CameraModel model;
  model.kind = lens::CameraKind::kFisheye;
  model.projection = lens::Projection::kEquidistant;
  model.image_width_px = 1280;
  model.image_height_px = 960;
  model.principal_point_px = {639.5, 479.5};
  model.fov_deg = 185.0;
  model.focal_px = Eigen::Vector2d::Constant(480.0 / kHalfFieldRad);
  model.position_m = {0.0, 0.0, 0.5};
  // The top rim of the body: radius 0.15 m, 0.2 m below the camera; plus 3 px.
  model.self_mask_radius_px = std::ceil(model.focal_px.x() * std::atan2(0.15, 0.20)) + 3.0;
  return model;
}

Arena Arena::load(const std::string& path) {
  return read(options::Section::load(path));
}

Arena Arena::read(const options::Section& section) {
  Arena arena;
  section.read("name", arena.name);
  readFrames(section.child("frames"), arena);
  arena.floor = Floor::read(section.child("floor"));
  arena.light = Light::read(section.child("light"));
  arena.image = ImageFormation::read(section.child("image"));
  for (const options::Section& row : section.list("obstacles")) arena.solids.push_back(Solid::read(row));
  readMoves(section, arena);
  if (section.has("walls")) addWalls(section.child("walls"), arena.floor.size_m, arena.solids);
  const options::Section robots = section.child("robots");
  for (const std::string& name : robots.keys()) {
    arena.robots.push_back(readRobot(robots.child(name), name, arena.floor.size_m));
  }
  if (arena.robots.empty()) section.fail("robots", "must list at least one robot");
  std::sort(arena.robots.begin(), arena.robots.end(),
            [](const ArenaRobot& a, const ArenaRobot& b) { return a.name < b.name; });
  readCameras(section, arena);
  if (section.has("markers")) arena.markers = dataset::MarkerSet::read(section.child("markers"));
  arena.world = section.child("world");
  arena.formation = section.child("formation");
  arena.has_formation = section.has("formation");
  arena.random = section.child("random");
  section.finish();
  return arena;
}

TimeNs Arena::periodNs() const {
  return static_cast<TimeNs>(std::llround(1e9 / rate_hz));
}

int Arena::frames() const {
  return static_cast<int>(std::floor(duration_s * rate_hz + 1e-9)) + 1;
}

int Arena::robotIndex(const std::string& robot_name) const {
  for (std::size_t i = 0; i < robots.size(); ++i) {
    if (robots[i].name == robot_name) return static_cast<int>(i);
  }
  return -1;
}

const ArenaRobot& Arena::robot(const std::string& robot_name) const {
  const int index = robotIndex(robot_name);
  if (index < 0) throw options::Error("arena " + name + " has no robot " + robot_name);
  return robots[static_cast<std::size_t>(index)];
}

const ArenaCamera& Arena::camera(const std::string& camera_id) const {
  for (const ArenaCamera& camera : cameras) {
    if (camera.id == camera_id) return camera;
  }
  throw options::Error("arena " + name + " has no camera " + camera_id);
}

Pose2 Arena::solidAt(int solid, double time_s) const {
  Pose2 pose = solids[static_cast<std::size_t>(solid)].map_from_solid;
  for (const ObstacleMove& move : moves) {
    if (move.obstacle != solid || time_s < move.at_s) continue;
    const double share = move.within_s > 0.0 ? std::min(1.0, (time_s - move.at_s) / move.within_s) : 1.0;
    pose = between(pose, move.map_from_solid, share);
  }
  return pose;
}

std::vector<dataset::MapObject> Arena::truthScene(double time_s) const {
  std::vector<dataset::MapObject> scene;
  for (std::size_t i = 0; i < solids.size(); ++i) {
    if (solids[i].wall) continue;
    dataset::MapObject object;
    object.id = i;
    object.outline_m = solids[i].footprintAt(solidAt(static_cast<int>(i), time_s));
    object.centroid_m = centroid(object.outline_m);
    object.height_m = solids[i].height_m;
    scene.push_back(object);
  }
  return scene;
}

Polygon Arena::truthRoom() const {
  if (std::none_of(solids.begin(), solids.end(), [](const Solid& solid) { return solid.wall; })) return {};
  const double x = 0.5 * floor.size_m.x(), y = 0.5 * floor.size_m.y();
  return {{-x, -y}, {x, -y}, {x, y}, {-x, y}};
}

}  // namespace omnifleet::synthetic
