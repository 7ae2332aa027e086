#include "tests/raycast/arena_recording.h"

#include <algorithm>
#include <cmath>
#include <set>
#include <stdexcept>

#include "dataset/writer.h"
#include "tests/raycast/arena_renderer.h"
#include "tests/raycast/room_path.h"

namespace omnifleet::raycast {
namespace {

constexpr double kLead_s = 1.0;  // the drive begins before the first image and ends after the last
constexpr double kFrontHeight_m = 0.085, kFrontPitch_deg = 12.0;
constexpr int kExposures = 5;  // images averaged for motion blur

lens::CameraModel pinhole(int width_px, int height_px, double focal_px, std::vector<double> distortion,
                          Random& random) {
  lens::CameraModel camera;
  camera.kind = lens::CameraKind::kPinhole;
  camera.projection = lens::Projection::kPinhole;
  camera.image_width_px = width_px;
  camera.image_height_px = height_px;
  camera.focal_px = {focal_px, focal_px};
  camera.principal_point_px = {0.5 * (width_px - 1) + random.between(-3.0, 3.0),
                               0.5 * (height_px - 1) + random.between(-3.0, 3.0)};
  camera.distortion = std::move(distortion);
  return camera;
}

/// 90° wide, at the front of the body.
lens::CameraModel frontCamera(Random& random) {
  constexpr double kFocal_px = 160.0;
  lens::CameraModel camera = pinhole(320, 240, kFocal_px,
                                     {random.between(-0.05, -0.02), random.between(0.0, 0.01),
                                      random.between(-0.0005, 0.0005), random.between(-0.0005, 0.0005), 0.0},
                                     random);
  camera.position_m = {kBody.high.x(), 0.0, kFrontHeight_m};
  camera.rotation_rpy_deg = {0.0, -90.0 + kFrontPitch_deg, 0.0};
  return camera;
}

/// c1 over the left two thirds of the arena (zones 1 and 2), c2 over the right two thirds. The image rows
/// run across the arena.
lens::CameraModel ceilingCamera(const Extent& room, int index, double k1, double tilt_deg, Random& random) {
  constexpr double kAbove_m = 2.5, kMargin_m = 0.05;
  const double side = index == 0 ? -1.0 : 1.0, height = kAbove_m + random.between(-0.05, 0.05),
               half_seen = room.size().x() / 3.0 + kMargin_m;
  // The distorted image of the farthest marker along the rows' normal reaches the image border.
  const double reach = half_seen / (height - kBodyHeight_m), k2 = 0.05;
  const double focal = 0.5 * 480 / (reach * (1.0 + k1 * reach * reach + k2 * std::pow(reach, 4.0)));
  lens::CameraModel camera = pinhole(640, 480, focal,
                                     {k1 + random.between(-0.02, 0.02), k2, random.between(-0.001, 0.001),
                                      random.between(-0.001, 0.001), 0.0},
                                     random);
  camera.position_m = {side * room.size().x() / 6.0 + random.between(-0.02, 0.02),
                       random.between(-0.03, 0.03), height};
  camera.rotation_rpy_deg = {random.between(-tilt_deg, tilt_deg), random.between(-tilt_deg, tilt_deg),
                             (index == 0 ? 0.0 : 180.0) + random.between(-2.0, 2.0)};
  return camera;
}

TimeNs nanoseconds(double seconds) {
  return static_cast<TimeNs>(std::llround(1e9 * seconds));
}

std::vector<TimeNs> timesOf(int count, double rate_hz, double offset_s) {
  std::vector<TimeNs> times;
  for (int k = 0; k < count; ++k) times.push_back(kBegin_ns + nanoseconds(offset_s + k / rate_hz));
  return times;
}

/// What sensor.yaml states: the camera with the errors of its calibration.
lens::CameraModel calibrated(lens::CameraModel camera, const ArenaOptions& options, Random& random) {
  camera.focal_px *= 1.0 + (random.below(2) == 0 ? 1.0 : -1.0) * options.focal_error;
  const double direction = random.between(0.0, 2.0 * M_PI);
  camera.rotation_rpy_deg.x() += options.tilt_error_deg * std::cos(direction);
  camera.rotation_rpy_deg.y() += options.tilt_error_deg * std::sin(direction);
  return camera;
}

std::vector<ArenaBox> movingAt(const ArenaScene& scene, const ArenaStory& story, double drive_s) {
  std::vector<ArenaBox> moving;
  for (int r = 0; r < kMapping; ++r) moving.push_back(scene.robotAt(r, story.drive.at(r, drive_s)));
  return moving;
}

/// Mean of the images over the exposure time.
template <typename Render>
cv::Mat3f exposed(TimeNs middle_ns, double exposure_s, const Render& render) {
  if (exposure_s <= 0.0) return render(middle_ns);
  cv::Mat3f sum;
  for (int k = 0; k < kExposures; ++k) {
    const cv::Mat3f image = render(middle_ns + nanoseconds(exposure_s * ((k + 0.5) / kExposures - 0.5)));
    if (sum.empty())
      sum = image / kExposures;
    else
      sum += image / kExposures;
  }
  return sum;
}

void writeFront(const std::string& folder, int robot, const ArenaStory& story, const ArenaScene& scene,
                const ArenaOptions& options, Random& random) {
  const ArenaRenderer renderer(scene, story.front);
  dataset::ImageStreamWriter images(folder, arenaRobot(robot) + "/front",
                                    calibrated(story.front, options, random), "jpg");
  unsigned frame = static_cast<unsigned>(robot) << 20U;
  for (const TimeNs time_ns : story.front_times_ns) {
    const cv::Mat3f linear = exposed(time_ns, options.exposure_s, [&](TimeNs at_ns) {
      const double at_s = story.driveTime(at_ns);
      return renderer.fromRobot(story.drive.at(robot, at_s), movingAt(scene, story, at_s), robot);
    });
    images.write(time_ns, developed(linear, options.light, options.noise, options.seed, ++frame));
  }
}

void writeCeiling(const std::string& folder, std::size_t camera, const ArenaStory& story,
                  const ArenaScene& scene, const ArenaOptions& options, Random& random) {
  ArenaRenderer renderer(scene, story.ceiling[camera]);
  dataset::ImageStreamWriter images(folder, "ceiling/c" + std::to_string(camera + 1),
                                    calibrated(story.ceiling[camera], options, random), "jpg");
  auto frame = static_cast<unsigned>(camera + kRobots) << 20U;
  for (const TimeNs time_ns : story.ceiling_times_ns) {
    const cv::Mat3f linear =
        exposed(time_ns - nanoseconds(options.stale_s), options.exposure_s,
                [&](TimeNs at_ns) { return renderer.fixed(movingAt(scene, story, story.driveTime(at_ns))); });
    images.write(time_ns, developed(linear, options.light, options.noise, options.seed, ++frame));
  }
}

void writeTruth(const std::string& folder, const ArenaStory& story) {
  std::vector<dataset::MapObject> blocks;
  for (const Solid& block : story.layout.house.furniture) blocks.push_back(truthOf(block, blocks.size()));
  dataset::writeTruthScene(folder, blocks);
  dataset::writeTruthRoom(folder, story.layout.house.inside);
  std::set<TimeNs> times(story.front_times_ns.begin(), story.front_times_ns.end());
  times.insert(story.ceiling_times_ns.begin(), story.ceiling_times_ns.end());
  for (int r = 0; r < kRobots; ++r) {
    std::vector<dataset::StampedPose> poses;
    if (r < kMapping)
      for (const TimeNs time_ns : times)
        poses.push_back({time_ns, story.posesAt(time_ns)[static_cast<std::size_t>(r)]});
    else
      for (const TimeNs time_ns : story.ceiling_times_ns)
        poses.push_back({time_ns, story.posesAt(time_ns)[static_cast<std::size_t>(r)]});
    dataset::writeTruthTrajectory(folder, arenaRobot(r), poses);
  }
}

}  // namespace

double ArenaStory::driveTime(TimeNs time_ns) const {
  const double time_s = secondsOf(time_ns);
  if (wait_s <= 0.0) return kLead_s + time_s;
  // A cycle begins with the wait. Half a nanosecond, so that rounding moves no frame into the next cycle.
  const double cycle_s = move_s + wait_s, cycles = std::floor((time_s + 5e-10) / cycle_s);
  return kLead_s + cycles * move_s + std::max(0.0, time_s - cycles * cycle_s - wait_s);
}

std::vector<Pose2> ArenaStory::posesAt(TimeNs time_ns) const {
  std::vector<Pose2> poses;
  for (int r = 0; r < kMapping; ++r) poses.push_back(drive.at(r, driveTime(time_ns)));
  poses.insert(poses.end(), layout.parked.begin(), layout.parked.end());
  return poses;
}

ArenaStory arenaStory(const ArenaOptions& options) {
  if (options.frames < 1 || !(options.rate_hz > 0.0) || options.ceiling_rate_hz < 0.0 ||
      options.ceiling_offset_s < 0.0 || options.stale_s < 0.0 || options.stale_s > kLead_s ||
      options.wait_s < 0.0)
    throw std::runtime_error(
        "raycast: an arena needs at least one frame, positive rates, and a stale time of at most 1 s");
  Random random(options.seed * 7919U + 29U);
  ArenaLayout layout = arenaLayout(options, random);
  const double move_s = 1.0 / options.rate_hz, cycle_s = move_s + options.wait_s,
               duration_s = options.frames * cycle_s;
  ArenaDrive drive(layout, options.frames * move_s + options.ceiling_offset_s + 2.0 * kLead_s, random);
  const lens::CameraModel front = frontCamera(random);
  std::vector<lens::CameraModel> ceiling;
  for (int k = 0; k < 2; ++k)
    ceiling.push_back(
        ceilingCamera(layout.house.rooms.front(), k, options.ceiling_k1, options.ceiling_tilt_deg, random));
  const double ceiling_hz = options.ceiling_rate_hz > 0.0 ? options.ceiling_rate_hz : options.rate_hz;
  const int ceiling_frames = std::max(1, static_cast<int>(std::floor(duration_s * ceiling_hz + 1e-9)));
  return {std::move(layout),
          std::move(drive),
          front,
          ceiling,
          timesOf(options.frames, 1.0 / cycle_s, options.wait_s),
          timesOf(ceiling_frames, ceiling_hz, options.ceiling_offset_s),
          move_s,
          options.wait_s};
}

void recordArena(const std::string& folder, const ArenaOptions& options) {
  const ArenaStory story = arenaStory(options);
  const ArenaScene scene(story.layout, options);
  Random random(options.seed * 104729U + 31U);
  std::vector<dataset::RobotRecording> robots(kRobots);
  for (int r = 0; r < kRobots; ++r) {
    robots[static_cast<std::size_t>(r)].name = arenaRobot(r);
    robots[static_cast<std::size_t>(r)].body = arenaBody();
  }
  dataset::writeDatasetYaml(folder, robots);
  for (int r = 0; r < kMapping; ++r) writeFront(folder, r, story, scene, options, random);
  for (std::size_t k = 0; k < story.ceiling.size(); ++k)
    writeCeiling(folder, k, story, scene, options, random);
  dataset::writeMarkers(folder, story.layout.markers);
  writeTruth(folder, story);
}

}  // namespace omnifleet::raycast
