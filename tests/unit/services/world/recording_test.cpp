#include "world/recording.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::world {
namespace {

synthetic::Arena tinyArena() {
  return synthetic::Arena::read(options::Section::parse(R"(
name: tiny
frames: {rate_hz: 5, duration_s: 2}
floor: {size_m: [3, 2]}
obstacles:
  - {kind: cylinder, pose: [0.9, 0.5, 0], radius_m: 0.1, height_m: 0.2}
moves:
  - {obstacle: 0, at_s: 1.0, pose: [0.9, -0.5, 0]}
robots:
  r1: {initial_pose: [0, 0, 0.2], waypoints: [[0.2, 0.04]]}
  r2: {initial_pose: [-0.8, 0, 0], speeds: [0, 0.1, 0.1, 1.0, 0.0, 0.0]}
rigs:
  fisheye: {camera_model: fisheye, projection: equidistant, image_width: 96, image_height: 72, focal_px: 22.0,
            principal_point_px: [47.5, 35.5], fov_deg: 185, position_m: [0, 0, 0.5]}
ceiling:
  c1: {camera_model: pinhole, image_width: 96, image_height: 72, focal_px: 60, principal_point_px: [47.5, 35.5],
       position_m: [0, 0, 3]}
markers:
  {kind: patches, height_m: 0.302, team_rgb: [20, 90, 220], team_offset_m: [-0.06, 0], individual_offset_m: [0.06, 0],
   patch_size_m: [0.09, 0.12], robots: {r1: {rgb: [230, 60, 60]}, r2: {rgb: [60, 200, 60]}}}
)",
                                                        "tiny.yaml"));
}

class Recording : public testing::Test {
 protected:
  void SetUp() override {
    folder_ = testing::TempDir() + "/omnifleet_recording_" + std::to_string(::getpid());
  }
  void TearDown() override { std::filesystem::remove_all(folder_); }
  std::string folder_;
};

std::map<std::string, std::string> filesOf(const std::string& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    std::ostringstream text;
    text << std::ifstream(entry.path(), std::ios::binary).rdbuf();
    files[std::filesystem::relative(entry.path(), folder).string()] = text.str();
  }
  return files;
}

TEST_F(Recording, IsCompleteDataset) {
  const RecordingReport report = record(tinyArena(), {}, folder_);
  EXPECT_TRUE(report.collisions.empty());
  const dataset::Dataset data = dataset::Dataset::open(folder_);
  EXPECT_TRUE(data.warnings.empty());
  ASSERT_EQ(data.robots.size(), 2u);
  ASSERT_EQ(data.ceiling.size(), 1u);
  ASSERT_TRUE(data.markers.has_value());
  ASSERT_TRUE(data.robots[0].fisheye.has_value());
  const auto& rows = data.robots[0].fisheye->rows;
  ASSERT_EQ(static_cast<int>(rows.size()), report.frames);
  EXPECT_EQ(rows[1].time_ns - rows[0].time_ns, 200'000'000);
  const cv::Mat image = cv::imread(rows.back().path);
  EXPECT_EQ(image.cols, 96);
  EXPECT_EQ(data.robots[0].wheels.size(), rows.size());

  const dataset::GroundTruth truth = dataset::GroundTruth::load(folder_);
  ASSERT_EQ(truth.trajectories.at("r1").size(), rows.size());
  EXPECT_EQ(truth.trajectories.at("r1")[3].time_ns, rows[3].time_ns);
  ASSERT_EQ(truth.scene.size(), 1u);
}

TEST_F(Recording, WheelsIntegrateToTruth) {
  RecordingOptions options;
  options.world.scale_sigma = 0.0;
  options.world.noise = 0.0;
  options.cameras = options.ceiling = false;
  record(tinyArena(), options, folder_);
  const dataset::Dataset data = dataset::Dataset::open(folder_);
  const dataset::GroundTruth truth = dataset::GroundTruth::load(folder_);
  for (const dataset::RobotRecording& robot : data.robots) {
    motion::WheelIntegrator wheels(robot.body.wheel_separation_m, {});
    for (const dataset::WheelRow& row : robot.wheels) wheels.add(row.time_ns, row.left_mps, row.right_mps);
    Pose2 pose = robot.initial_pose.value();
    for (const dataset::StampedPose& stamped : truth.trajectories.at(robot.name)) {
      const Motion motion = wheels.motionTo(stamped.time_ns);
      if (motion.valid) pose = pose * motion.previous_from_current;
      // Rows are written to 1 µm/s and hold mean speeds over a frame in which the motors change their speed.
      EXPECT_LT((pose.translation() - stamped.map_from_base.translation()).norm(), 2e-3) << robot.name;
    }
    EXPECT_GT((pose.translation() - robot.initial_pose->translation()).norm(), 0.08) << robot.name;
  }
}

TEST_F(Recording, IsReproducible) {
  record(tinyArena(), {}, folder_);
  const auto first = filesOf(folder_);
  std::filesystem::remove_all(folder_);
  record(tinyArena(), {}, folder_);
  EXPECT_EQ(first, filesOf(folder_));
  EXPECT_GT(first.size(), 30u);
}

TEST_F(Recording, ThrowsWhenFolderIsNotWritable) {
  std::ofstream(folder_) << "a file";
  EXPECT_THROW(record(tinyArena(), {}, folder_), std::runtime_error);
}

}  // namespace
}  // namespace omnifleet::world
