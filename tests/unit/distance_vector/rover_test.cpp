// The drive of a simulated Mars rover (data set forward_rover): sand between mountains, with a map of the
// navigable cells (1 m).

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "tests/test_data.h"
#include "tests/unit/distance_vector/measure.h"

namespace omnifleet::test {
namespace {

using distance_vector::DistanceVector;

/// From the corners of a square of 1 m in the grid image, at (14, 140), (301, 140), (200, 96), (118, 96). Its
/// sides are 287 and 82 px wide, so the horizon is at row 78.4, the vanishing point at column 159.5. The
/// pitch follows from the horizon, the focal length from the depth of 1 m between both sides, the height from
/// the rows. The square begins 0.6 m in front of the rover.
lens::CameraModel roverCamera() {
  constexpr double kNear_px = 287.0, kFar_px = 82.0, kNearRow = 140.0, kFarRow = 96.0, kCentreRow = 79.5;
  constexpr double kHorizonRow = (kFarRow * kNear_px - kNearRow * kFar_px) / (kNear_px - kFar_px);
  constexpr double kFocal_px = 1.0 / (1.0 / kFar_px - 1.0 / kNear_px);
  lens::CameraModel model;
  model.kind = lens::CameraKind::kPinhole;
  model.projection = lens::Projection::kPinhole;
  model.image_width_px = 320;
  model.image_height_px = 160;
  model.focal_px = {kFocal_px, kFocal_px};
  model.principal_point_px = {159.5, kCentreRow};
  model.position_m = {0.6 - kFocal_px / kNear_px, 0.0, (kNearRow - kHorizonRow) / kNear_px};
  model.rotation_rpy_deg = {0.0, -90.0 + std::atan2(kCentreRow - kHorizonRow, kFocal_px) * 180.0 / M_PI, 0.0};
  return model;
}

struct Step {
  std::string image;
  double x_m, y_m, yaw_rad, tilt_deg;
};

std::vector<Step> readLog(const std::string& path) {
  std::vector<Step> steps;
  std::ifstream file(path);
  std::string line;
  std::getline(file, line);
  while (std::getline(file, line)) {
    std::vector<std::string> fields;
    std::stringstream stream(line);
    for (std::string field; std::getline(stream, field, ';');) fields.push_back(field);
    if (fields.size() < 10) continue;
    const auto turned = [&](std::size_t i) { return std::remainder(std::stod(fields[i]), 360.0); };
    steps.push_back({fields[0].substr(fields[0].rfind('/') + 1), std::stod(fields[5]), std::stod(fields[6]),
                     std::stod(fields[8]) * M_PI / 180.0,
                     std::max(std::abs(turned(7)), std::abs(turned(9)))});
  }
  return steps;
}

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

/// Calls each(cell) along a ray on the map, 0.1 m at a time, until it returns false.
template <class Each>
void along(const Eigen::Vector2d& from_m, double heading, double to_m, const Each& each) {
  for (double r = 0.5; r < to_m; r += 0.1) {
    const cv::Point cell(static_cast<int>(from_m.x() + r * std::cos(heading)),
                         static_cast<int>(from_m.y() + r * std::sin(heading)));
    if (cell.x < 0 || cell.y < 0 || cell.x >= 200 || cell.y >= 200 || !each(cell)) return;
  }
}

// Free floor of the whole run against the map: fidelity is the share of the claimed cells that are navigable,
// coverage the share of the navigable cells in sight (within the field of view and the measured range, not
// behind others) that are claimed. A cell is claimed if at least 10 of its ray samples are free: one frame
// gives about 100 to a near cell. Frames in which the rover tilts by more than 1.5° have another horizon.
TEST(DistanceVectorRover, ClaimsNavigableFloor) {
  OMNIFLEET_NEEDS_DATA(folder, "forward_rover");
  const cv::Mat1b map = cv::imread(folder + "/calibration_images/map_bw.png", cv::IMREAD_GRAYSCALE);
  ASSERT_EQ(map.size(), cv::Size(200, 200));
  const lens::CameraModel model = roverCamera();
  const lens::Camera camera(model);
  const distance_vector::Options options;
  DistanceVector vector(camera, options);
  const double reach_m = model.focal_px.x() * model.position_m.z() / options.walk.horizon_px;
  cv::Mat1i free(map.size(), 0);
  cv::Mat1b seen(map.size(), static_cast<std::uint8_t>(0));
  int frames = 0, faults = 0;
  const char* pictures = std::getenv("OMNIFLEET_PICTURES");
  for (const Step& step : readLog(folder + "/test_dataset/robot_log.csv")) {
    const cv::Mat image = cv::imread(folder + "/test_dataset/IMG/" + step.image);
    if (image.empty()) continue;
    vector.process(image);
    if (pictures && frames % 20 == 0)
      cv::imwrite(std::string(pictures) + "/rover_" + std::to_string(frames) + ".png",
                  picture(image, vector));
    ++frames;
    if (step.tilt_deg > 1.5) continue;
    faults += vector.fault() != DistanceVector::Fault::kNone ? 1 : 0;
    const Scan& scan = vector.scan();
    const Eigen::Vector2d from =
        Eigen::Vector2d(step.x_m, step.y_m) +
        model.position_m.x() * Eigen::Vector2d(std::cos(step.yaw_rad), std::sin(step.yaw_rad));
    for (std::size_t i = 0; i < scan.range_m.size(); ++i) {
      const double bearing = std::remainder(
          2.0 * M_PI * static_cast<double>(i) / static_cast<double>(scan.range_m.size()), 2.0 * M_PI);
      if (std::abs(bearing) > 0.9) continue;  // field of view: ±54°
      along(from, step.yaw_rad + bearing, reach_m, [&](const cv::Point& cell) {
        if (map(cell)) seen(cell) = 1;
        return map(cell) != 0;
      });
      if (scan.label[i] == RayLabel::kInvalid) continue;
      along(from, step.yaw_rad + bearing, static_cast<double>(scan.range_m[i]), [&](const cv::Point& cell) {
        ++free(cell);
        return true;
      });
    }
  }
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
