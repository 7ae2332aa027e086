// Markers in images of the second renderer: poses by one ceiling camera against the truth, with walls that
// hide parts, cards in colours of the markers, shadows and noise.

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <string>
#include <vector>

#include "markers/patch_finder.h"
#include "tests/raycast/arena_recording.h"
#include "tests/raycast/arena_renderer.h"

namespace omnifleet::raycast {
namespace {

/// Errors over all cameras, frames and seeds.
struct MarkerErrors {
  int visible = 0, found = 0;  ///< visible as a whole; of them reported
  int others = 0;              ///< reported while partly hidden or cut
  int wrong = 0;               ///< more than 3 cm or 17° off: another object, robot or heading
  double mean_m = 0.0, mean_rad = 0.0, worst_m = 0.0, worst_rad = 0.0;
};

/// Whether something that is higher stands between a point of a marker and the camera.
bool isHidden(const House& house, const Eigen::Vector3d& point, const Eigen::Vector3d& camera) {
  constexpr double kStep_m = 0.005;
  for (const auto* list : {&house.walls, &house.furniture}) {
    for (const Solid& solid : *list) {
      const double to = (solid.height_m - point.z()) / (camera.z() - point.z());
      if (to <= 0.0) continue;
      const Eigen::Vector2d way = to * (camera - point).head<2>();
      const int steps = 1 + static_cast<int>(way.norm() / kStep_m);
      for (int k = 0; k <= steps; ++k) {
        const Eigen::Vector2d own =
            solid.map_from_solid.inverse() * Eigen::Vector2d(point.head<2>() + way * k / steps);
        if ((2.0 * own.cwiseAbs() - solid.size_m).maxCoeff() < 0.0) return true;
      }
    }
  }
  return false;
}

/// Whether a camera shows the top of a body as a whole.
bool isWhole(const ArenaStory& story, const lens::Camera& camera, const Pose2& pose) {
  constexpr double kBorder_px = 3.0;
  constexpr int kSteps = 6;  // along each side
  for (int i = 0; i <= kSteps; ++i) {
    for (int j = 0; j <= kSteps; ++j) {
      const Eigen::Vector2d share(static_cast<double>(i) / kSteps, static_cast<double>(j) / kSteps),
          place = pose * (kBody.low + share.cwiseProduct(kBody.size()));
      const Eigen::Vector3d point(place.x(), place.y(), kBodyHeight_m);
      const auto pixel = camera.pixelFromPoint(point);
      if (!pixel || pixel->minCoeff() < kBorder_px ||
          pixel->x() > camera.model().image_width_px - 1 - kBorder_px ||
          pixel->y() > camera.model().image_height_px - 1 - kBorder_px)
        return false;
      if (isHidden(story.layout.house, point, camera.model().position_m)) return false;
    }
  }
  return true;
}

void add(MarkerErrors& errors, const ArenaOptions& options, double blur_px) {
  const ArenaStory story = arenaStory(options);
  const ArenaScene scene(story.layout, options);
  unsigned frame = 0;
  for (const lens::CameraModel& model : story.ceiling) {
    const lens::Camera camera(model);
    ArenaRenderer renderer(scene, model);
    const auto finder = markers::MarkerFinder::make(camera, story.layout.markers, {});
    for (const TimeNs time_ns : story.ceiling_times_ns) {
      std::vector<ArenaBox> moving;
      for (int r = 0; r < kMapping; ++r)
        moving.push_back(scene.robotAt(r, story.drive.at(r, story.driveTime(time_ns))));
      cv::Mat3f linear = renderer.fixed(moving).clone();
      if (blur_px > 0.0) cv::GaussianBlur(linear, linear, {0, 0}, blur_px, blur_px, cv::BORDER_REPLICATE);
      cv::Mat image = developed(linear, options.light, options.noise, options.seed, ++frame);
      std::vector<std::uint8_t> file;
      cv::imencode(".jpg", image, file, {cv::IMWRITE_JPEG_QUALITY, 95});  // as recordings have it
      image = cv::imdecode(file, cv::IMREAD_COLOR);
      const std::vector<Pose2> poses = story.posesAt(time_ns);
      std::map<std::string, bool> whole;
      for (int r = 0; r < kRobots; ++r) {
        whole[arenaRobot(r)] = isWhole(story, camera, poses[static_cast<std::size_t>(r)]);
        errors.visible += whole[arenaRobot(r)] ? 1 : 0;
      }
      std::map<std::string, bool> missing = whole;
      for (const markers::Detection& d : finder->find(image, time_ns)) {
        const Pose2 error = poses[static_cast<std::size_t>(d.robot[1] - '1')].inverse() * d.map_from_base;
        const double m = error.translation().norm(), rad = std::abs(error.theta_rad);
        missing[d.robot] = false;
        if (m > 0.03 || rad > 0.3) {
          ++errors.wrong;
          std::printf("  seed %u: %s %.1f mm, %.1f deg off\n", options.seed, d.robot.c_str(), 1e3 * m,
                      rad * 180.0 / M_PI);
          continue;
        }
        ++(whole[d.robot] ? errors.found : errors.others);
        errors.mean_m += m, errors.mean_rad += rad;
        errors.worst_m = std::max(errors.worst_m, m), errors.worst_rad = std::max(errors.worst_rad, rad);
      }
      const bool misses = std::any_of(missing.begin(), missing.end(), [](const auto& r) { return r.second; });
      if (misses)
        for (const auto& [robot, is_missing] : missing)
          if (is_missing)
            std::printf("  seed %u: %s not found, frame %u\n", options.seed, robot.c_str(), frame);
      if (const char* pictures = std::getenv("OMNIFLEET_PICTURES"); pictures && (misses || frame == 1))
        cv::imwrite(std::string(pictures) + "/markers_" + std::to_string(options.seed) + "_" +
                        std::to_string(frame) + ".png",
                    image);
    }
  }
}

MarkerErrors measure(const char* name, ArenaOptions options, double blur_px, unsigned first_seed,
                     unsigned count) {
  MarkerErrors errors;
  for (unsigned seed = first_seed; seed < first_seed + count; ++seed) {
    options.seed = seed;
    options.layout = 1 + static_cast<int>(seed % 2);
    add(errors, options, blur_px);
  }
  const double n = std::max(1, errors.found + errors.others);
  errors.mean_m /= n, errors.mean_rad /= n;
  constexpr double kDeg = 180.0 / M_PI;
  std::printf("%s: %d of %d found, %d others, %d wrong, mean %.2f mm %.2f deg, worst %.2f mm %.2f deg\n",
              name, errors.found, errors.visible, errors.others, errors.wrong, 1e3 * errors.mean_m,
              kDeg * errors.mean_rad, 1e3 * errors.worst_m, kDeg * errors.worst_rad);
  return errors;
}

constexpr double kBlur_px = 0.8;  // of the lens

ArenaOptions hardOptions(bool patches) {
  ArenaOptions options;
  options.makeHard();
  options.patches = patches;
  options.ceiling_tilt_deg = 8.0;
  options.noise = 6.0;
  options.rate_hz = 2.5;
  options.frames = 15;
  return options;
}

class ArenaMarkers : public ::testing::TestWithParam<bool> {};

/// Seeds 3000–3002, or those of OMNIFLEET_SEEDS=FIRST-LAST.
TEST_P(ArenaMarkers, AreMeasuredByTiltedDistortedDimNoisyCameras) {
  unsigned first = 3000, last = 3002;
  if (const char* seeds = std::getenv("OMNIFLEET_SEEDS")) std::sscanf(seeds, "%u-%u", &first, &last);
  const MarkerErrors errors = measure(GetParam() ? "patches" : "cover_tail_head", hardOptions(GetParam()),
                                      kBlur_px, first, last - first + 1);
  EXPECT_GE(errors.found, 0.995 * errors.visible);
  EXPECT_EQ(errors.wrong, 0);
  EXPECT_LE(errors.mean_m, 0.0025);
  EXPECT_LE(errors.mean_rad, 0.7 * M_PI / 180.0);
}

INSTANTIATE_TEST_SUITE_P(Kinds, ArenaMarkers, ::testing::Bool(),
                         [](const auto& kind) { return kind.param ? "Patches" : "CoverTailHead"; });

}  // namespace
}  // namespace omnifleet::raycast
