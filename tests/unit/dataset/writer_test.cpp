#include "dataset/writer.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

#include "dataset/frame_source.h"
#include "dataset/ground_truth.h"
#include "tests/test_data.h"

namespace omnifleet::dataset {
namespace {

RobotRecording robot(const std::string& name) {
  RobotRecording r;
  r.name = name;
  r.initial_pose = Pose2{0.1, -0.2, 0.3};
  r.body.radius_m = 0.15;
  r.body.height_m = 0.3;
  r.body.wheel_separation_m = 0.26;
  return r;
}

TEST(Writer, ReadsWhatItWrites) {
  const test::TempFolder folder;
  RobotRecording square = robot("r2");
  square.initial_pose.reset();
  square.body.radius_m = 0.0;
  square.body.footprint_m = {{0.1, 0.1}, {-0.1, 0.1}, {-0.1, -0.1}, {0.1, -0.1}};
  writeDatasetYaml(folder.path(), {robot("r1"), square});
  lens::CameraModel camera;
  camera.image_width_px = 32;
  camera.image_height_px = 24;
  camera.focal_px = {8.1, 8.2};
  camera.principal_point_px = {15.5, 11.5};
  camera.fov_deg = 185.0;
  const cv::Mat image(24, 32, CV_8UC3, cv::Scalar(1, 2, 3));
  {
    ImageStreamWriter images(folder.path(), "r1/fisheye", camera);
    images.write(1000, image);
    images.writeMissing(2000);
    WheelsWriter(folder.path(), "r1").write({1000, 0.125, -0.1});
    ObservationsWriter(folder.path(), "r2").write({1500, "lm 1", 2.5, -0.75});
    const float none = std::numeric_limits<float>::infinity();
    LaserWriter(folder.path(), "r2").write({1600, -1.5, 0.1, {1.25f, none, 3.0f}});
  }
  const Dataset d = Dataset::open(folder.path());
  EXPECT_TRUE(d.warnings.empty());
  EXPECT_EQ(d.robots[0].initial_pose->vector(), robot("r1").initial_pose->vector());
  EXPECT_FALSE(d.robots[1].initial_pose);
  EXPECT_EQ(d.robots[1].body.footprint_m, square.body.footprint_m);
  EXPECT_EQ(d.robots[0].fisheye->camera.focal_px, camera.focal_px);
  EXPECT_EQ(d.robots[0].wheels.at(0).left_mps, 0.125);
  EXPECT_EQ(d.robots[1].observations.at(0).id, "lm 1");
  EXPECT_EQ(d.robots[1].observations.at(0).bearing_rad, -0.75);
  EXPECT_TRUE(std::isinf(d.robots[1].laser.at(0).range_m.at(1)));
  const auto source = openStream(*d.robots[0].fisheye, Colour::kBgr);
  cv::Mat back;
  FrameInfo info;
  ASSERT_TRUE(source->next(back, info));
  EXPECT_EQ(info.state, FrameState::kOk);
  EXPECT_EQ(cv::norm(back, image, cv::NORM_INF), 0.0);
  ASSERT_TRUE(source->next(back, info));
  EXPECT_EQ(info.state, FrameState::kMissing);
}

TEST(Writer, KeepsGroundTruthSeparate) {
  const test::TempFolder folder;
  EXPECT_THROW(GroundTruth::load(folder.path()), std::runtime_error);
  MapObject box;
  box.outline_m = {{0, 0}, {1, 0}, {1, 1}};
  box.centroid_m = centroid(box.outline_m);
  writeTruthTrajectory(folder.path(), "r1", {{5, Pose2{1, 2, 0.5}}});
  writeTruthScene(folder.path(), {box});
  const GroundTruth truth = GroundTruth::load(folder.path());
  ASSERT_EQ(truth.trajectories.at("r1").size(), 1u);
  EXPECT_EQ(truth.trajectories.at("r1")[0].map_from_base.x_m, 1.0);
  EXPECT_TRUE(truth.has_scene);
  EXPECT_EQ(truth.scene.at(0).outline_m, box.outline_m);
  EXPECT_TRUE(truth.room.empty());
  writeTruthRoom(folder.path(), box.outline_m);
  EXPECT_EQ(GroundTruth::load(folder.path()).room, box.outline_m);
  writeObjects(folder.path() + "/groundtruth/room.geojson", {box, box});
  EXPECT_THROW(GroundTruth::load(folder.path()), std::runtime_error);
}

TEST(Writer, ReportsUnwritableFolder) {
  EXPECT_THROW(WheelsWriter("/proc/nowhere", "r1"), std::runtime_error);
  EXPECT_THROW(writeDatasetYaml("/proc/nowhere", {robot("r1")}), std::runtime_error);
}

}  // namespace
}  // namespace omnifleet::dataset
