#include "evaluate/report.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "dataset/atomic_file.h"
#include "dataset/writer.h"
#include "tests/test_data.h"

namespace omnifleet::evaluate {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;

constexpr double kShift_m = 0.02;

dataset::MapObject box(std::uint64_t id, double x, double y) {
  dataset::MapObject object;
  object.id = id;
  object.outline_m = {{x - 0.1, y - 0.1}, {x + 0.1, y - 0.1}, {x + 0.1, y + 0.1}, {x - 0.1, y + 0.1}};
  object.centroid_m = {x, y};
  return object;
}

/// A recording with truth and a run that is off by 2 cm in x.
class Evaluate : public ::testing::Test {
 protected:
  void SetUp() override {
    dataset::RobotRecording r1;
    r1.name = "r1";
    dataset::writeDatasetYaml(recording_, {r1});
    lens::CameraModel camera;
    camera.image_width_px = camera.image_height_px = 8;
    camera.focal_px = {3, 3};
    dataset::ImageStreamWriter frames(recording_, "r1/fisheye", camera);
    std::vector<dataset::StampedPose> truth, estimate;
    dataset::G2oGraph places;
    for (int i = 0; i < 10; ++i) {
      const Pose2 pose{0.1 * i, 0.02 * i * i, 0.05 * i};
      truth.push_back({i * 100, pose});
      estimate.push_back({i * 100, Pose2{pose.x_m + kShift_m, pose.y_m, pose.theta_rad}});
      places.vertices.push_back({i, Pose2{2 * pose.x_m, 2 * pose.y_m, 0}});
      frames.writeMissing(i * 100);
    }
    dataset::writeTruthTrajectory(recording_, "r1", truth);
    dataset::writeTruthScene(recording_, {box(0, 1, 1), box(1, -1, 0)});
    dataset::writeTum(out_ + "/trajectories/r1.tum", estimate);
    dataset::writeG2o(out_ + "/places/r1.g2o", places);
    dataset::writeObjects(out_ + "/objects.geojson", {box(7, 1 + kShift_m, 1), box(8, 3, 3)});
    dataset::writeAtomic(out_ + "/tracks/r1.csv", "#t,track,kind,x,y\n0,1,obstacle,1,1\n");
  }

  test::TempFolder folder_;
  const std::string recording_ = folder_ / "recording", out_ = folder_ / "out";
};

TEST_F(Evaluate, FindsTheErrorsThatWerePutIn) {
  const Report report = evaluateRun(out_, recording_);
  ASSERT_TRUE(report.map);
  EXPECT_EQ(report.map->matches.size(), 1u);
  EXPECT_NEAR(report.map->x_error_m, kShift_m, 1e-9);
  EXPECT_EQ(report.map->missed.size(), 1u);
  EXPECT_EQ(report.map->falsely_found.size(), 1u);
  ASSERT_EQ(report.robots.size(), 1u);
  const RobotReport& r1 = report.robots[0];
  EXPECT_EQ(r1.frames, 10);
  EXPECT_EQ(r1.path.poses, 10);
  EXPECT_NEAR(r1.path.distance_m, kShift_m, 1e-8);
  EXPECT_LT(r1.ate_m.rmse, 1e-8) << "a shift is aligned away";
  ASSERT_TRUE(r1.shape_difference);
  EXPECT_NEAR(*r1.shape_difference, 0.0, 1e-9) << "scale does not count";
  ASSERT_TRUE(report.kinds);
  EXPECT_EQ(report.kinds->obstacle.right, 1);
}

TEST_F(Evaluate, TableAndJsonSayTheSame) {
  const Report report = evaluateRun(out_, recording_);
  EXPECT_THAT(table(report), AllOf(HasSubstr("found 1 of 2, missed 1, false 1"), HasSubstr("2.00 /  0.00 cm"),
                                   HasSubstr("10/10"), HasSubstr("false, at (3.00, 3.00) m")));
  const auto json = nlohmann::json::parse(metricsJson(report));
  EXPECT_NEAR(json["map"]["x_error_m"].get<double>(), kShift_m, 1e-9);
  EXPECT_EQ(json["map"]["missed"], nlohmann::json::array({1}));
  EXPECT_EQ(json["map"]["false"], nlohmann::json::array({8}));
  EXPECT_TRUE(json["map"]["distances_error_m"].is_null()) << "one match has no distances";
  EXPECT_NEAR(json["paths"]["r1"]["distance_m"].get<double>(), kShift_m, 1e-8);
  EXPECT_EQ(json["paths_mean"]["robots"], 1);
  EXPECT_EQ(json["kinds"]["obstacle"]["f1"], 1.0);
}

TEST_F(Evaluate, WhatIsMissingIsNamed) {
  std::filesystem::remove(out_ + "/trajectories/r1.tum");
  const Report report = evaluateRun(out_, recording_);
  EXPECT_FALSE(report.robots[0].has_trajectory);
  EXPECT_THAT(table(report), HasSubstr("has no trajectory"));
  std::filesystem::remove(out_ + "/objects.geojson");
  EXPECT_THROW(evaluateRun(out_, recording_), std::runtime_error);
  EXPECT_THROW(evaluateRun(folder_ / "nowhere", recording_), options::Error);
  std::filesystem::remove_all(recording_ + "/groundtruth");
  EXPECT_THROW(evaluateRun(out_, recording_), options::Error);
}

TEST(EvaluateSample, TruthAgainstItselfIsPerfect) {
  OMNIFLEET_NEEDS_DATA(recording, "rendered_sample");
  const test::TempFolder out;
  std::filesystem::copy(recording + "/groundtruth/scene.geojson", out / "objects.geojson");
  std::filesystem::create_directory(out / "trajectories");
  for (const char* name : {"r1.tum", "r2.tum", "r3.tum"}) {
    std::filesystem::copy(recording + "/groundtruth/" + name, out / "trajectories");
  }
  const Report report = evaluateRun(out.path(), recording);
  EXPECT_EQ(report.map->matches.size(), 5u);
  EXPECT_EQ(report.map->x_error_m, 0.0);
  EXPECT_NEAR(report.map->iou, 1.0, 1e-5);
  ASSERT_EQ(report.robots.size(), 3u);
  for (const RobotReport& robot : report.robots) {
    EXPECT_EQ(robot.path.poses, 17);
    EXPECT_EQ(robot.path.max_m, 0.0);
  }
}

}  // namespace
}  // namespace omnifleet::evaluate
