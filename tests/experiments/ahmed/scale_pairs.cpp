#include "tests/experiments/ahmed/scale_pairs.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <stdexcept>

#include "dataset/atomic_file.h"
#include "distance_vector/distance_vector.h"
#include "localizer/ceiling_front_end.h"
#include "tests/experiments/plot/plot.h"
#include "tests/raycast/arena_recording.h"
#include "tests/raycast/arena_renderer.h"
#include "tests/raycast/room_path.h"

namespace omnifleet::ahmed {
namespace {

constexpr int kExperiments = 10;                        // as in Table 1
constexpr double kNearest_m = 0.21, kFarthest_m = 1.3;  // from base_link; α is up to 2.1 as in Table 1
constexpr int kColumns = 10;  // on both sides of the middle: rows of the distance vector

/// An arena without blocks and cards, the parked robots in its right corners.
raycast::ArenaStory emptyArena(const raycast::ArenaOptions& options) {
  raycast::ArenaStory story = raycast::arenaStory(options);
  story.layout.house.furniture.clear();
  story.layout.cards.clear();
  const Eigen::Vector2d corner = story.layout.house.rooms.front().high;
  story.layout.parked = {{corner.x() - 0.15, corner.y() - 0.15, M_PI},
                         {corner.x() - 0.15, 0.15 - corner.y(), M_PI}};
  return story;
}

raycast::Solid boxAhead(const Pose2& map_from_base, double distance_m) {
  constexpr double kDeep_m = 0.1, kWide_m = 0.3, kHigh_m = 0.2;
  raycast::Solid box;
  const Pose2 middle = map_from_base * Pose2{distance_m + 0.5 * kDeep_m, 0.0, 0.0};
  box.map_from_solid = middle;
  box.size_m = {kDeep_m, kWide_m};
  box.height_m = kHigh_m;
  box.albedo = {0.42, 0.10, 0.07};
  return box;
}

/// Pixels from the bottom row to the end of the floor, the median of the columns in the middle.
double measuredByRobot(distance_vector::DistanceVector& vector, const cv::Mat& image) {
  vector.process(image);
  std::vector<double> distances;
  for (int u = image.cols / 2 - kColumns; u < image.cols / 2 + kColumns; ++u) {
    const auto row = static_cast<double>(vector.edgeRows()[static_cast<std::size_t>(u)]);
    if (std::isfinite(row)) distances.push_back(image.rows - 1 - row);
  }
  if (distances.size() < kColumns) throw std::runtime_error("calibration: the robot does not see the box");
  std::nth_element(distances.begin(), distances.begin() + kColumns / 2, distances.end());
  return distances[kColumns / 2];
}

raycast::ArenaOptions optionsOf(unsigned seed) {
  raycast::ArenaOptions options;
  options.seed = seed;
  options.frames = 1;
  return options;
}

/// For the rows of the boundary; the distances are not used.
distance_vector::Options literally() {
  distance_vector::Options options;
  options.method = distance_vector::Method::kLiteral;
  options.literal.metres_per_ceiling_px = 1.0;
  return options;
}

class Bench {
 public:
  Bench(unsigned seed, std::string folder)
      : folder_(std::move(folder)),
        options_(optionsOf(seed)),
        story_(emptyArena(options_)),
        vector_(lens::Camera(story_.front), literally()),
        finder_("ceiling/c1", story_.ceiling[0], story_.layout.markers, markers::FinderOptions{}) {}

  /// Distances from base_link that are even steps of d_r.
  std::vector<double> distances() const {
    const lens::Camera camera(story_.front);
    const auto row = [&](double x) { return camera.pixelFromPoint({x, 0.0, 0.0}).value().y(); };
    std::vector<double> distances;
    for (int k = 0; k < kExperiments; ++k) {
      const double share = static_cast<double>(k) / (kExperiments - 1);
      const double wanted = row(kNearest_m) + share * (row(kFarthest_m) - row(kNearest_m));
      double low = kNearest_m, high = kFarthest_m;
      while (high - low > 1e-6) (row(0.5 * (low + high)) > wanted ? low : high) = 0.5 * (low + high);
      distances.push_back(0.5 * (low + high));
    }
    return distances;
  }

  distance_vector::ScalePair measure(int experiment, double distance_m) {
    const raycast::Extent room = story_.layout.house.rooms.front();
    const Pose2 pose{0.7 * room.low.x(), 0.0, 0.0};
    raycast::ArenaLayout layout = story_.layout;
    layout.house.furniture.push_back(boxAhead(pose, distance_m));
    const raycast::ArenaScene scene(layout, options_);
    const std::vector<raycast::ArenaBox> moving{scene.robotAt(0, pose)};
    const auto frame = static_cast<unsigned>(experiment);
    const cv::Mat front =
        raycast::developed(raycast::ArenaRenderer(scene, story_.front).fromRobot(pose, moving, 0),
                           options_.light, options_.noise, options_.seed, 2 * frame);
    const cv::Mat ceiling = raycast::developed(raycast::ArenaRenderer(scene, story_.ceiling[0]).fixed(moving),
                                               options_.light, options_.noise, options_.seed, 2 * frame + 1);
    experiments::save(fmt::format("{}/front_{}.png", folder_, experiment), front);
    experiments::save(fmt::format("{}/ceiling_{}.png", folder_, experiment), ceiling);
    // A pause of 10 s between two experiments: the robot has no track to continue.
    const Pose2 found = poseOfRobot(ceiling, raycast::kBegin_ns + experiment * TimeNs{10'000'000'000}, frame);
    const lens::Camera camera(story_.ceiling[0]);
    const auto pixel = [&](const Eigen::Vector2d& at) {
      return camera.pixelFromPoint({at.x(), at.y(), 0.0}).value();
    };
    return {measuredByRobot(vector_, front),
            (pixel(pose * Eigen::Vector2d(distance_m, 0.0)) - pixel(found.translation())).norm()};
  }

 private:
  Pose2 poseOfRobot(const cv::Mat& image, TimeNs time_ns, unsigned frame) {
    for (const Measurement& found : finder_.process(time_ns, frame, image))
      if (found.to == raycast::arenaRobot(0)) return {found.value.x(), found.value.y(), found.value.z()};
    throw std::runtime_error("calibration: the ceiling camera does not find the robot");
  }

  std::string folder_;
  raycast::ArenaOptions options_;
  raycast::ArenaStory story_;
  distance_vector::DistanceVector vector_;
  localizer::CeilingFrontEnd finder_;
};

}  // namespace

Calibration calibrate(unsigned seed, const std::string& folder) {
  dataset::makeDirectories(folder);
  Bench bench(seed, folder);
  Calibration result;
  const std::vector<double> distances = bench.distances();
  std::string csv = "# pixels; ten experiments as in Table 1 of Ahmed et al. 2013\nd_robot_px,d_ceiling_px\n";
  for (int k = 0; k < kExperiments; ++k) {
    const auto pair = bench.measure(k, distances[static_cast<std::size_t>(k)]);
    result.pairs.push_back(pair);
    csv += fmt::format("{:.1f},{:.1f}\n", pair.robot_px, pair.ceiling_px);
  }
  result.metres_per_ceiling_px = (distances.back() - distances.front()) /
                                 (result.pairs.back().ceiling_px - result.pairs.front().ceiling_px);
  dataset::writeAtomic(folder + "/pairs.csv", csv);
  return result;
}

}  // namespace omnifleet::ahmed
