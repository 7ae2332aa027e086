// Detections in externally rendered images against their exact ground truth.

#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <opencv2/imgcodecs.hpp>

#include "dataset/dataset.h"
#include "dataset/trajectory_files.h"
#include "markers/patch_finder.h"
#include "test_data.h"

namespace omnifleet::markers {
namespace {

TEST(RenderedSample, LocatesEveryVisibleRobotToAThirdOfAPixel) {
  const std::string folder = dataFolder() + "/rendered_sample";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no " << folder;
  const auto data = dataset::Dataset::open(folder);
  ASSERT_TRUE(data.markers.has_value());
  std::map<std::string, std::map<TimeNs, Pose2>> truth;
  for (const auto& robot : data.robots) {
    for (const auto& row : dataset::flat(dataset::readTum(folder + "/groundtruth/" + robot.name + ".tum"))) {
      truth[robot.name][row.time_ns] = row.map_from_base;
    }
  }
  int found = 0, inside = 0;
  double worst_m = 0.0, worst_rad = 0.0, sum_m = 0.0, sum_rad = 0.0;
  for (const auto& stream : data.ceiling) {
    const lens::Camera camera(stream.camera);
    auto finder = MarkerFinder::make(camera, *data.markers, {});
    for (const auto& row : stream.rows) {
      const cv::Mat image = cv::imread(row.path);
      const auto detections = finder->find(image, row.time_ns);
      for (const auto& [robot, poses] : truth) {
        // Fully visible: both patches with their corners (8 cm beyond their centres).
        const Pose2& pose = poses.at(row.time_ns);
        bool whole = true;
        for (const double x : {-0.14, 0.14}) {
          for (const double y : {-0.09, 0.09}) {
            const Eigen::Vector2d p = pose * Eigen::Vector2d(x, y);
            const auto pixel = camera.pixelFromPoint({p.x(), p.y(), data.markers->height_m});
            whole = whole && pixel && pixel->x() > 3 && pixel->y() > 3 && pixel->x() < image.cols - 4 &&
                    pixel->y() < image.rows - 4;
          }
        }
        inside += whole ? 1 : 0;
        for (const auto& d : detections) {
          if (d.robot != robot) continue;
          ++found;
          const Pose2 e = pose.inverse() * d.map_from_base;
          const double m = e.translation().norm(), rad = std::abs(e.theta_rad);
          worst_m = std::max(worst_m, m);
          worst_rad = std::max(worst_rad, rad);
          sum_m += m;
          sum_rad += rad;
          if (std::getenv("EACH") != nullptr) {
            std::printf("%s %s %.2f mm (%.2f %.2f) %.3f deg\n", stream.name.c_str(), robot.c_str(), 1e3 * m,
                        1e3 * e.x_m, 1e3 * e.y_m, e.theta_rad * 180 / M_PI);
          }
        }
      }
    }
  }
  std::printf("found %d of %d whole robots; mean %.2f mm %.3f deg, worst %.2f mm %.3f deg\n", found, inside,
              1e3 * sum_m / found, sum_rad / found * 180 / M_PI, 1e3 * worst_m, worst_rad * 180 / M_PI);
  EXPECT_GE(found, inside);
  // The renderer samples points, so an edge along the pixel grid is off by up to half a pixel (3.3 mm). All
  // edges of a robot that drives along x (r2) are such edges; slanted edges average to 0.3 mm. So the mean is
  // the criterion, and the worst error is limited by the pixel size.
  EXPECT_LE(sum_m / found, 0.001);
  EXPECT_LE(sum_rad / found, 0.15 * M_PI / 180.0);
  EXPECT_LE(worst_m, 0.0025);
  EXPECT_LE(worst_rad, 1.2 * M_PI / 180.0);  // half a pixel across the 17 px of a patch is 1.7°
}

}  // namespace
}  // namespace omnifleet::markers
