// Distance vectors of the drive of a simulated Mars rover (data set forward_rover): sand between mountains,
// with a map of the navigable cells (1 m). tests/external maps it with the whole pipeline.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <opencv2/imgcodecs.hpp>

#include "tests/test_data.h"
#include "tests/unit/distance_vector/measure.h"
#include "tests/unit/distance_vector/rover_data.h"

namespace omnifleet::test {
namespace {

using distance_vector::DistanceVector;

TEST(RoverCamera, MapsTheSquareOfTheGridImage) {
  const lens::Camera camera(roverCamera());
  const Eigen::Vector2d corners_px[] = {{14, 140}, {301, 140}, {200, 96}, {118, 96}};
  const Eigen::Vector2d corners_m[] = {{0.6, 0.5}, {0.6, -0.5}, {1.6, -0.5}, {1.6, 0.5}};
  for (int i = 0; i < 4; ++i) {
    const auto floor = camera.floorFromPixel(corners_px[i]);
    ASSERT_TRUE(floor);
    EXPECT_NEAR((*floor - corners_m[i]).norm(), 0.0, 0.02) << i;  // the corners are whole pixels
  }
}

// Free floor of the whole run against the map: fidelity is the share of the claimed cells that are navigable,
// coverage the share of the navigable cells in sight (within the field of view and the measured range, not
// behind others) that are claimed. A cell is claimed if at least 10 of its ray samples are free: one frame
// gives about 100 to a near cell. Frames in which the rover tilts by more than 1.5° have another horizon.
TEST(DistanceVectorRover, ClaimsNavigableFloor) {
  OMNIFLEET_NEEDS_DATA(folder, "forward_rover");
  const cv::Mat1b map = roverMap(folder);
  ASSERT_EQ(map.size(), cv::Size(200, 200));
  const lens::CameraModel model = roverCamera();
  const lens::Camera camera(model);
  const distance_vector::Options options;
  DistanceVector vector(camera, options);
  const double reach_m = model.focal_px.x() * model.position_m.z() / options.walk.horizon_px;
  cv::Mat1i free(map.size(), 0);
  std::vector<RoverStep> level;
  int frames = 0, faults = 0;
  const char* pictures = std::getenv("OMNIFLEET_PICTURES");
  for (const RoverStep& step : roverSteps(folder)) {
    const cv::Mat image = cv::imread(step.image);
    vector.process(image);
    if (pictures && frames % 20 == 0)
      cv::imwrite(std::string(pictures) + "/rover_" + std::to_string(frames) + ".png",
                  picture(image, vector));
    ++frames;
    if (step.tilt_deg > 1.5) continue;
    level.push_back(step);
    faults += vector.fault() != DistanceVector::Fault::kNone ? 1 : 0;
    const Scan& scan = vector.scan();
    const Eigen::Vector2d from = step.map_from_base * Eigen::Vector2d(model.position_m.x(), 0.0);
    for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
      const double bearing = std::remainder(
          2.0 * M_PI * static_cast<double>(i) / static_cast<double>(scan.range_m.size()), 2.0 * M_PI);
      if (std::abs(bearing) > 0.9 || scan.label[i] == RayLabel::kInvalid) continue;  // field of view: ±54°
      alongRoverMap(from, step.map_from_base.theta_rad + bearing, static_cast<double>(scan.range_m[i]),
                    [&](const cv::Point& cell) {
                      ++free(cell);
                      return true;
                    });
    }
  }
  const cv::Mat1b seen = roverSight(map, level, reach_m);
  constexpr int kLeastSamples = 10;
  int claimed = 0, navigable = 0, in_sight = 0, covered = 0;
  for (int y = 0; y < 200; ++y) {
    for (int x = 0; x < 200; ++x) {
      const bool claim = free(y, x) >= kLeastSamples;
      claimed += claim ? 1 : 0;
      navigable += claim && map(y, x) ? 1 : 0;
      in_sight += seen(y, x);
      covered += claim && seen(y, x) ? 1 : 0;
    }
  }
  ASSERT_GT(frames, 250);
  ASSERT_GT(claimed, 200);
  const double fidelity = static_cast<double>(navigable) / claimed,
               coverage = static_cast<double>(covered) / in_sight;
  std::printf("%d frames, %d faults, fidelity %.3f of %d cells, coverage %.3f of %d cells\n", frames, faults,
              fidelity, claimed, coverage, in_sight);
  EXPECT_GE(fidelity, 0.75);
  EXPECT_GE(coverage, 0.9);
  EXPECT_LT(faults, 0.05 * frames);
}

}  // namespace
}  // namespace omnifleet::test
