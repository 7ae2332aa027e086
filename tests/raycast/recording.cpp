#include "tests/raycast/recording.h"

#include <cmath>
#include <functional>
#include <stdexcept>

#include "dataset/writer.h"
#include "tests/raycast/random.h"

namespace omnifleet::raycast {
namespace {

constexpr double kFrame_s = 0.2, kRadius_m = 0.15, kHeight_m = 0.3, kSeparation_m = 0.26;
constexpr TimeNs kBegin_ns = 1'000'000'000'000, kFrame_ns = 200'000'000;
constexpr int kMaxTries = 1'000'000;

struct Path {
  std::vector<Pose2> poses;
  std::vector<Eigen::Vector2d> wheels_mps;  ///< left, right; from this pose to the next
};

Path randomPath(int robot, const RecordingOptions& options, Random& random) {
  const double begin = 2.0 * M_PI * robot / options.robots + random.between(0.0, 1.0),
               away_m = random.between(0.9, 1.5);
  Pose2 pose{away_m * std::cos(begin), 0.8 * away_m * std::sin(begin), 0.0};
  pose.theta_rad = std::atan2(-pose.y_m, -pose.x_m) + random.between(-1.0, 1.0);
  Path path;
  double speed = 0.0, turning = 0.0;
  for (int k = 0; k < options.frames; ++k) {
    if (k % 10 == 0) {
      const bool stands = random.between(0.0, 1.0) < 0.15;
      speed = random.between(0.1, 0.3) * (stands ? 0.0 : 1.0);
      turning = random.between(-0.6, 0.6);
    }
    path.poses.push_back(pose);
    path.wheels_mps.emplace_back(speed - 0.5 * kSeparation_m * turning,
                                 speed + 0.5 * kSeparation_m * turning);
    const double half = 0.5 * turning * kFrame_s,
                 chord = speed * kFrame_s * (std::abs(half) < 1e-9 ? 1.0 : std::sin(half) / half);
    pose = {pose.x_m + chord * std::cos(pose.theta_rad + half),
            pose.y_m + chord * std::sin(pose.theta_rad + half), pose.theta_rad + 2.0 * half};
  }
  return path;
}

double distance(const Pose2& a, const Pose2& b) {
  return (a.translation() - b.translation()).norm();
}

/// True if all paths lie inside the room and the robots keep 0.5 m between their centres.
bool areFree(const std::vector<Path>& paths) {
  for (std::size_t a = 0; a < paths.size(); ++a) {
    for (std::size_t k = 0; k < paths[a].poses.size(); ++k) {
      const Pose2& pose = paths[a].poses[k];
      if (std::abs(pose.x_m) > 2.2 || std::abs(pose.y_m) > 1.6) return false;
      for (std::size_t b = 0; b < a; ++b)
        if (distance(pose, paths[b].poses[k]) < 0.5) return false;
    }
  }
  return true;
}

template <typename Make, typename IsGood>
auto firstGood(Make make, IsGood isGood, const char* what) {
  for (int tries = 0; tries < kMaxTries; ++tries)
    if (auto one = make(); isGood(one)) return one;
  throw std::runtime_error(std::string("raycast: no valid ") + what +
                           " in 1000000 random tries; choose another seed");
}

double reach(const Solid& solid) {
  return 0.5 * (solid.round ? solid.size_m.x() : solid.size_m.norm());
}

Solid randomObstacle(const Eigen::Vector3d& floor, Random& random) {
  Solid obstacle;
  obstacle.round = random.between(0.0, 1.0) < 0.45;
  obstacle.map_from_solid = {random.between(-2.6, 2.6), random.between(-2.0, 2.0), random.between(0.0, M_PI)};
  obstacle.size_m = {random.between(0.14, 0.42), random.between(0.14, 0.42)};
  if (obstacle.round) obstacle.size_m.y() = obstacle.size_m.x();
  obstacle.height_m = random.between(0.08, 0.28);
  obstacle.albedo = firstGood(
      [&] { return random.colour(0.03, 0.8); },
      [&](const Eigen::Vector3d& c) { return (c.cwiseQuotient(floor).array() - 1.0).abs().maxCoeff() > 0.4; },
      "obstacle colour");
  obstacle.chequered = random.between(0.0, 1.0) < 0.3;
  return obstacle;
}

/// True if the obstacle is near a path, blocks no path, and keeps its distance to the other obstacles.
bool isFree(const Solid& obstacle, const std::vector<Path>& paths, const std::vector<Solid>& others) {
  double nearest = 1e9;
  for (const Path& path : paths)
    for (const Pose2& pose : path.poses) nearest = std::min(nearest, distance(pose, obstacle.map_from_solid));
  if (nearest < reach(obstacle) + 0.28 || nearest > 1.3) return false;
  return std::none_of(others.begin(), others.end(), [&](const Solid& other) {
    return distance(other.map_from_solid, obstacle.map_from_solid) < reach(obstacle) + reach(other) + 0.25;
  });
}

Room randomRoom(const RecordingOptions& options, const std::vector<Path>& paths, Random& random) {
  Room room;
  room.seed = options.seed;
  room.floor = options.floor;
  room.light = options.light;
  const double level = random.between(0.25, 0.55);
  room.floor_albedo = level * Eigen::Vector3d(random.between(0.85, 1.15), random.between(0.9, 1.1),
                                              random.between(0.75, 1.1));
  room.lamps = {{{random.between(-1.5, 0.0), random.between(-1.0, 1.0), 2.6}, 1.0},
                {{random.between(0.3, 2.0), random.between(-1.0, 1.0), 2.6}, random.between(0.3, 1.0)}};
  if (options.lit_by != Light::kSoft)
    for (Lamp& lamp : room.lamps) lamp.radius_m = 0.1;
  if (options.lit_by == Light::kOneLamp) {
    room.lamps.pop_back();
    room.ambient = 0.12;
    room.vignette = 0.3;
    room.is_linear = true;
  }
  for (int i = 0; i < options.obstacles; ++i)
    room.solids.push_back(
        firstGood([&] { return randomObstacle(room.floor_albedo, random); },
                  [&](const Solid& obstacle) { return isFree(obstacle, paths, room.solids); }, "obstacle"));
  for (int i = 0; i < options.sheets; ++i)
    room.markings.push_back(
        {{random.between(-2.0, 2.0), random.between(-1.5, 1.5), random.between(0.0, M_PI)},
         {0.297, 0.21},
         random.colour(0.03, 0.8)});
  if (options.tape)
    for (const Pose2& at : {Pose2{0.0, 0.3, 0.1}, Pose2{0.4, 0.0, 1.5}})
      room.markings.push_back({at, {6.0, 0.05}, {0.8, 0.7, 0.05}});
  return room;
}

/// A lens of 185° whose image circle is as large as the image is high.
lens::CameraModel cameraOf(const RecordingOptions& options, Random& random) {
  lens::CameraModel camera;
  camera.projection = options.projection;
  camera.image_width_px = options.width_px;
  camera.image_height_px = options.height_px;
  camera.fov_deg = 185.0;
  camera.position_m.z() = 0.5;
  const auto radiusOf = [&](double angle) {
    if (options.projection == lens::Projection::kEquisolid) return 2.0 * std::sin(0.5 * angle);
    return options.projection == lens::Projection::kStereographic ? 2.0 * std::tan(0.5 * angle) : angle;
  };
  const double focal = (0.5 * options.height_px - 2.0) / radiusOf(camera.fov_deg * M_PI / 360.0);
  camera.focal_px = {focal, focal};
  camera.principal_point_px = {0.5 * (options.width_px - 1) + random.between(-3.0, 3.0),
                               0.5 * (options.height_px - 1) + random.between(-3.0, 3.0)};
  camera.self_mask_radius_px =
      std::ceil(focal * radiusOf(std::atan2(kRadius_m, camera.position_m.z() - kHeight_m)) + 4.0);
  return camera;
}

std::vector<Solid> robotsAt(const std::vector<Path>& paths, std::size_t frame) {
  std::vector<Solid> robots;
  for (std::size_t r = 0; r < paths.size(); ++r)
    robots.push_back({true,
                      paths[r].poses[frame],
                      {2.0 * kRadius_m, 2.0 * kRadius_m},
                      kHeight_m,
                      r % 2 != 0 ? Eigen::Vector3d(0.10, 0.10, 0.12) : Eigen::Vector3d(0.60, 0.60, 0.62)});
  return robots;
}

void recordRobot(const std::string& folder, const std::string& name, std::size_t robot, const Room& room,
                 const lens::CameraModel& camera, const std::vector<Path>& paths, Random& random) {
  dataset::ImageStreamWriter images(folder, name + "/fisheye", camera);
  dataset::WheelsWriter wheels(folder, name);
  const Eigen::Vector2d scale(1.0 + random.normal(0.01), 1.0 + random.normal(0.01));
  std::vector<dataset::StampedPose> truth;
  for (std::size_t k = 0; k < paths[robot].poses.size(); ++k) {
    const TimeNs now_ns = kBegin_ns + static_cast<TimeNs>(k) * kFrame_ns;
    const Pose2& pose = paths[robot].poses[k];
    const Eigen::Vector2d driven = paths[robot].wheels_mps[k].cwiseProduct(scale);
    wheels.write(
        {now_ns, driven.x() * (1.0 + random.normal(0.02)), driven.y() * (1.0 + random.normal(0.02))});
    truth.push_back({now_ns, pose});
    const auto frame = static_cast<unsigned>(k * paths.size() + robot);
    images.write(now_ns, render(room, camera, pose, robotsAt(paths, k), frame));
  }
  dataset::writeTruthTrajectory(folder, name, truth);
}

}  // namespace

void record(const std::string& folder, const RecordingOptions& options) {
  Random random(options.seed);
  const auto drive = [&] {
    std::vector<Path> paths;
    for (int r = 0; r < options.robots; ++r) paths.push_back(randomPath(r, options, random));
    return paths;
  };
  const std::vector<Path> paths = firstGood(drive, areFree, "robot paths");
  const Room room = randomRoom(options, paths, random);
  const lens::CameraModel camera = cameraOf(options, random);
  std::vector<dataset::RobotRecording> robots(paths.size());
  std::vector<dataset::MapObject> scene;
  for (const Solid& obstacle : room.solids) scene.push_back(truthOf(obstacle, scene.size()));
  for (std::size_t r = 0; r < paths.size(); ++r) {
    robots[r].name = "r" + std::to_string(r + 1);
    robots[r].initial_pose = paths[r].poses.front();
    robots[r].body.radius_m = kRadius_m;
    robots[r].body.height_m = kHeight_m;
    robots[r].body.wheel_separation_m = kSeparation_m;
  }
  dataset::writeDatasetYaml(folder, robots);
  dataset::writeTruthScene(folder, scene);
  for (std::size_t r = 0; r < paths.size(); ++r)
    recordRobot(folder, robots[r].name, r, room, camera, paths, random);
}

}  // namespace omnifleet::raycast
