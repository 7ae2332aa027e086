// A recording from another renderer through local mapper and classifier. The ground truth replaces the poses
// that the localizer would publish, and is the reference for the labels.

#include <gtest/gtest.h>

#include <cstdlib>
#include <filesystem>
#include <iostream>
#include <map>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "classifier/classifier.h"
#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "local_mapper/local_mapper.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::classifier {
namespace {

std::string sampleFolder() {
  if (const char* folder = std::getenv("OMNIFLEET_DATA")) return std::string(folder) + "/rendered_sample";
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  return std::string(source ? source : ".") + "/../shared/data/rendered_sample";
}

struct Count {
  int right = 0, missed = 0, wrong = 0, switches = 0;
  double error_m = 0.0;
  double f1() const { return 2.0 * right / (2.0 * right + missed + wrong); }
  double meanError() const { return error_m / std::max(1, right); }
};

class Recorded : public testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(sampleFolder())) GTEST_SKIP() << "no " << sampleFolder();
    data_ = dataset::Dataset::open(sampleFolder());
    truth_ = dataset::GroundTruth::load(sampleFolder());
    for (const auto& robot : data_.robots) bodies_[robot.name] = robot.body;
  }

  Pose2 poseOf(const std::string& robot, std::size_t frame) const {
    return truth_.trajectories.at(robot)[frame].map_from_base;
  }

  std::vector<PoseEstimate> published(std::size_t frame) const {
    std::vector<PoseEstimate> poses;
    for (const auto& robot : data_.robots) {
      PoseEstimate pose;
      pose.robot = robot.name;
      pose.acquired_ns = robot.fisheye->rows[frame].time_ns;
      pose.valid = true;
      pose.map_from_base = poseOf(robot.name, frame);
      pose.covariance = Eigen::Vector3d(1e-4, 1e-4, 1e-5).asDiagonal();
      poses.push_back(pose);
    }
    return poses;
  }

  /// Compares every visible track with the robot at its place, if there is one.
  void compare(const Objects& objects, const std::string& self, std::size_t frame,
               std::map<std::string, std::uint32_t>& ids, Count& count) const {
    std::map<std::string, const Track*> track_of;
    for (const Track& track : objects.tracks) {
      if (!track.visible) continue;
      std::string here;
      double apart = 0.15;
      for (const auto& robot : data_.robots) {
        const Eigen::Vector2d place = poseOf(self, frame).inverse() * poseOf(robot.name, frame).translation();
        const double distance = (place - track.position_m).norm();
        if (robot.name == self || distance > apart) continue;
        apart = distance;
        here = robot.name;
      }
      if (here.empty()) {
        count.wrong += track.kind == ObjectKind::kRobot ? 1 : 0;
        continue;
      }
      ++(track.kind == ObjectKind::kRobot ? count.right : count.missed);
      if (track.kind == ObjectKind::kRobot) count.error_m += apart;
      if (frame < 2) continue;  // before the first poses arrive, objects in line are one blob
      const auto id = ids.emplace(here, track.id).first;
      count.switches += id->second != track.id ? 1 : 0;
      id->second = track.id;
    }
  }

  Count replay(bool feedback) const {
    Count count;
    for (const auto& robot : data_.robots) {
      local_mapper::LocalMapper mapper(lens::Camera(robot.fisheye->camera), local_mapper::Options());
      Classifier classifier(Classifier::Options(), robot.name, bodies_);
      motion::WheelIntegrator wheels(robot.body.wheel_separation_m, {});
      for (const auto& row : robot.wheels) wheels.add(row.time_ns, row.left_mps, row.right_mps);
      std::map<std::string, std::uint32_t> ids;
      for (std::size_t f = 0; f < robot.fisheye->rows.size(); ++f) {
        const dataset::ImageRow& row = robot.fisheye->rows[f];
        local_mapper::Frame frame;
        frame.acquired_ns = row.time_ns;
        frame.sequence = row.sequence;
        frame.image = cv::imread(row.path);
        LocalMap map = mapper.process(frame, wheels.motionTo(row.time_ns));
        map.robot = robot.name;
        const auto poses = feedback && f > 0 ? published(f - 1) : std::vector<PoseEstimate>();
        const Objects& objects = classifier.process(map, poses);
        if (std::getenv("OMNIFLEET_TRACE")) trace(objects, robot.name, f);
        compare(objects, robot.name, f, ids, count);
      }
    }
    std::cout << (feedback ? "with" : "without") << " poses: F1 " << count.f1() << ", " << count.right
              << " right, " << count.missed << " missed, " << count.wrong << " wrong, switches "
              << count.switches << ", centre " << 100.0 * count.meanError() << " cm\n";
    return count;
  }

  void trace(const Objects& objects, const std::string& self, std::size_t frame) const {
    for (const Track& track : objects.tracks) {
      const Eigen::Vector2d place = poseOf(self, frame) * track.position_m;
      std::cerr << self << " " << frame << " track " << track.id << " " << toString(track.kind) << " "
                << track.kind_probability << (track.visible ? " at " : " unseen at ") << place.transpose()
                << " h " << track.height_m << " v " << track.velocity_mps.norm() << " solidity "
                << track.solidity << "\n";
    }
  }

  dataset::Dataset data_;
  dataset::GroundTruth truth_;
  std::map<std::string, RobotBody> bodies_;
};

TEST_F(Recorded, ClassifiesRobotsWithPoses) {
  const Count count = replay(true);
  EXPECT_GE(count.f1(), 0.98);  // docs/methods/evaluation.md
  EXPECT_EQ(count.switches, 0);
  EXPECT_GT(count.right, 20);
}

TEST_F(Recorded, ClassifiesRobotsByShapeAndMotionAlone) {
  const Count count = replay(false);
  EXPECT_GE(count.f1(), 0.90);  // a robot merged with another object is not recognized until they separate
  EXPECT_EQ(count.switches, 0);
}

}  // namespace
}  // namespace omnifleet::classifier
