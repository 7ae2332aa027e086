#include "tests/raycast/room_recording.h"

#include <cmath>
#include <optional>
#include <stdexcept>

#include "dataset/writer.h"
#include "tests/raycast/adaptive_render.h"
#include "tests/raycast/room_persons.h"
#include "tests/raycast/room_tour.h"

namespace omnifleet::raycast {
namespace {

constexpr double kCamera_m = 0.5;

void check(const FurnishedOptions& options) {
  if (options.symmetric && options.rooms > 1)
    throw std::runtime_error("raycast: two rooms cannot be symmetric; record one room");
  if (options.symmetric && options.decorated)
    throw std::runtime_error("raycast: a symmetric room cannot be decorated");
  if (options.loop && (options.robots != 1 || options.kidnapped_s || options.step_min_m <= 0.0))
    throw std::runtime_error("raycast: a loop needs one robot, images by distance and no kidnapping");
  for (const auto& interval : {options.black, options.slip})
    if (interval && !(interval->begin_s < interval->end_s))
      throw std::runtime_error("raycast: an interval of time must begin before it ends");
}

lens::CameraModel cameraOf(const FurnishedOptions& options, Random& random) {
  lens::CameraModel camera;
  camera.projection = lens::Projection::kEquidistant;
  camera.image_width_px = options.width_px;
  camera.image_height_px = options.height_px;
  camera.fov_deg = 185.0;
  camera.position_m.z() = kCamera_m;
  const double focal = (0.5 * options.height_px - 2.0) / (camera.fov_deg * M_PI / 360.0);
  camera.focal_px = {focal, focal};
  camera.principal_point_px = {0.5 * (options.width_px - 1) + random.between(-3.0, 3.0),
                               0.5 * (options.height_px - 1) + random.between(-3.0, 3.0)};
  camera.self_mask_radius_px =
      std::ceil(focal * std::atan2(kRobotRadius_m, kCamera_m - kRobotHeight_m) + 4.0);
  return camera;
}

/// Bodies on the floor at the time of a frame: robots, except for a lifted one, and persons.
std::vector<Solid> bodiesAt(const FurnishedScene& scene, std::size_t frame) {
  std::vector<Solid> bodies;
  const DriveFrame& now = scene.drive.frames[frame];
  for (std::size_t r = now.is_first_lifted ? 1 : 0; r < now.poses.size(); ++r) {
    bodies.push_back({true,
                      now.poses[r],
                      {2.0 * kRobotRadius_m, 2.0 * kRobotRadius_m},
                      kRobotHeight_m,
                      r % 2 != 0 ? Eigen::Vector3d(0.10, 0.10, 0.12) : Eigen::Vector3d(0.60, 0.60, 0.62)});
  }
  if (!scene.persons.empty())
    bodies.insert(bodies.end(), scene.persons[frame].begin(), scene.persons[frame].end());
  return bodies;
}

/// A lifted robot takes no images.
void writeImages(const std::string& folder, const std::string& name, std::size_t robot,
                 const FurnishedScene& scene, const FurnishedOptions& options) {
  lens::CameraModel calibrated = scene.camera;  // with the errors of its calibration
  calibrated.focal_px *= 1.0 + options.focal_error;
  calibrated.rotation_rpy_deg.x() += options.tilt_error_deg;
  calibrated.rotation_rpy_deg.y() -= options.tilt_error_deg;
  dataset::ImageStreamWriter images(folder, name + "/fisheye", calibrated);
  std::optional<AdaptiveRenderer> quick;
  if (options.fast) quick.emplace(scene.room, scene.camera);
  for (std::size_t k = 0; k < scene.drive.frames.size(); ++k) {
    const DriveFrame& frame = scene.drive.frames[k];
    if (robot == 0 && frame.is_first_lifted) continue;
    if (robot == 0 && options.black && options.black->contains(secondsOf(frame.time_ns))) {
      images.write(frame.time_ns, cv::Mat3b(options.height_px, options.width_px, cv::Vec3b(0, 0, 0)));
      continue;
    }
    const auto number = static_cast<unsigned>(k * frame.poses.size() + robot);
    const std::vector<Solid> bodies = bodiesAt(scene, k);
    images.write(frame.time_ns, quick ? quick->render(frame.poses[robot], bodies, number)
                                      : render(scene.room, scene.camera, frame.poses[robot], bodies, number));
  }
}

void writeWheels(const std::string& folder, const std::string& name, std::size_t robot, const Drive& drive,
                 const FurnishedOptions& options, const Eigen::Vector2d& scale, Random& random) {
  dataset::WheelsWriter wheels(folder, name);
  const auto offset_ns = static_cast<TimeNs>(std::llround(1e9 * options.wheel_clock_offset_s));
  for (const WheelStep& step : drive.wheels) {
    const bool slips = robot == 0 && options.slip && options.slip->contains(secondsOf(step.time_ns));
    const double factor = options.wheel_speed_factor * (slips ? kSlip : 1.0);
    const Eigen::Vector2d measured = step.speed_mps[robot].cwiseProduct(scale);
    dataset::WheelRow row{step.time_ns, measured.x() * (1.0 + random.normal(options.wheel_noise)),
                          measured.y() * (1.0 + random.normal(options.wheel_noise))};
    row.time_ns += offset_ns;
    row.left_mps *= factor;
    row.right_mps *= factor;
    wheels.write(row);
  }
}

}  // namespace

std::vector<dataset::RobotRecording> robotsOf(const FurnishedOptions& options, const DriveFrame& first,
                                              Random& random) {
  std::vector<dataset::RobotRecording> robots(static_cast<std::size_t>(options.robots));
  for (std::size_t r = 0; r < robots.size(); ++r) {
    robots[r].name = "r" + std::to_string(r + 1);
    const double away = options.start_error_m, turn = random.between(0.0, 2.0 * M_PI);
    robots[r].initial_pose =
        first.poses[r] * Pose2{away * std::cos(turn), away * std::sin(turn),
                               options.start_error_rad * (random.below(2) == 0 ? 1.0 : -1.0)};
    robots[r].body.radius_m = kRobotRadius_m;
    robots[r].body.height_m = kRobotHeight_m;
    robots[r].body.wheel_separation_m = kWheelSeparation_m;
  }
  return robots;
}

FurnishedScene furnishedScene(const FurnishedOptions& options, Random& random,
                              const std::function<DrivePlan(const FreeSpace&)>& plan) {
  check(options);
  FurnishedScene scene;
  scene.house = furnishedHouse(options, random);
  const FreeSpace space(scene.house, kClearance_m);
  DrivePlan drive;
  if (options.loop) drive = tourOf(options, space, random);
  if (plan) drive = plan(space);
  scene.drive = driveAll(options, space, random, drive);
  scene.room = litRoom(scene.house, options, random);
  scene.camera = cameraOf(options, random);
  if (options.occluded_share > 0.0) scene.persons = personsAround(scene.house, scene.drive, options);
  return scene;
}

void writeRobot(const std::string& folder, const std::string& name, std::size_t robot,
                const FurnishedScene& scene, const FurnishedOptions& options, Random& random) {
  const Eigen::Vector2d scale(1.0 + random.normal(options.wheel_bias),
                              1.0 + random.normal(options.wheel_bias));
  writeImages(folder, name, robot, scene, options);
  if (options.wheels) writeWheels(folder, name, robot, scene.drive, options, scale, random);
  std::vector<dataset::StampedPose> poses;
  for (const DriveFrame& frame : scene.drive.frames) poses.push_back({frame.time_ns, frame.poses[robot]});
  dataset::writeTruthTrajectory(folder, name, poses);
}

std::vector<dataset::MapObject> truthOf(const House& house) {
  std::vector<dataset::MapObject> truth;
  for (const Solid& piece : house.furniture) truth.push_back(truthOf(piece, truth.size()));
  return truth;
}

void recordFurnished(const std::string& folder, const FurnishedOptions& options) {
  Random random(options.seed * 7919U + 17U);
  const FurnishedScene scene = furnishedScene(options, random);
  const auto robots = robotsOf(options, scene.drive.frames.front(), random);
  dataset::writeDatasetYaml(folder, robots);
  dataset::writeTruthScene(folder, truthOf(scene.house));
  if (options.walls) dataset::writeTruthRoom(folder, scene.house.inside);
  for (std::size_t r = 0; r < robots.size(); ++r)
    writeRobot(folder, robots[r].name, r, scene, options, random);
}

}  // namespace omnifleet::raycast
