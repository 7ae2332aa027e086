// A foreign renderer's recording through the stages before the estimator, as the services chain them, in one
// process: images → local map → objects → poses, with and without the ceiling cameras. The truth is only
// compared with.

#include <gtest/gtest.h>

#include <Eigen/Dense>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <memory>
#include <opencv2/imgcodecs.hpp>

#include "classifier/classifier.h"
#include "dataset/dataset.h"
#include "dataset/ground_truth.h"
#include "local_mapper/local_mapper.h"
#include "localizer/ceiling_front_end.h"
#include "localizer/estimator_stage.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::localizer {
namespace {

std::string sampleFolder() {
  if (const char* folder = std::getenv("OMNIFLEET_DATA")) return std::string(folder) + "/rendered_sample";
  const char* source = std::getenv("OMNIFLEET_SOURCE_DIR");
  return std::string(source != nullptr ? source : ".") + "/../shared/data/rendered_sample";
}

struct Eyes {
  const dataset::RobotRecording* recording;
  std::unique_ptr<local_mapper::LocalMapper> mapper;
  std::unique_ptr<classifier::Classifier> classifier;
  motion::WheelIntegrator wheels;
};

struct Errors {
  double mean_m = 0.0, worst_m = 0.0, worst_rad = 0.0;
  std::vector<estimation::LandmarkEstimate> landmarks;
};

std::vector<Eyes> openEyes(const dataset::Dataset& data) {
  std::map<std::string, RobotBody> bodies;
  for (const auto& robot : data.robots) bodies[robot.name] = robot.body;
  std::vector<Eyes> eyes;
  for (const auto& robot : data.robots) {
    Eyes e;
    e.recording = &robot;
    e.mapper = std::make_unique<local_mapper::LocalMapper>(lens::Camera(robot.fisheye->camera),
                                                           local_mapper::Options());
    e.classifier =
        std::make_unique<classifier::Classifier>(classifier::Classifier::Options(), robot.name, bodies);
    e.wheels = motion::WheelIntegrator(robot.body.wheel_separation_m, {});
    for (const auto& row : robot.wheels) e.wheels.add(row.time_ns, row.left_mps, row.right_mps);
    eyes.push_back(std::move(e));
  }
  return eyes;
}

Objects look(Eyes& eyes, const dataset::ImageRow& row, const std::vector<PoseEstimate>& previous) {
  local_mapper::Frame frame;
  frame.acquired_ns = row.time_ns;
  frame.sequence = row.sequence;
  frame.image = cv::imread(row.path);
  LocalMap map = eyes.mapper->process(frame, eyes.wheels.motionTo(row.time_ns));
  map.robot = eyes.recording->name;
  return eyes.classifier->process(map, previous);
}

Errors replay(const dataset::Dataset& data, const estimation::EstimatorOptions& options, bool ceiling) {
  std::vector<estimation::RobotSetup> setups;
  for (const auto& robot : data.robots) setups.push_back({robot.name, robot.body, robot.initial_pose});
  EstimatorStage stage(setups, options);
  std::vector<Eyes> eyes = openEyes(data);
  std::vector<CeilingFrontEnd> front_ends;
  for (const auto& stream : data.ceiling)
    front_ends.emplace_back(stream.name, stream.camera, *data.markers, markers::FinderOptions());
  const auto truth = dataset::GroundTruth::load(data.folder);
  std::vector<PoseEstimate> poses;
  Errors errors;
  int count = 0;
  for (std::size_t f = 0; f < data.robots[0].fisheye->rows.size(); ++f) {
    std::vector<Objects> objects;
    for (Eyes& e : eyes) objects.push_back(look(e, e.recording->fisheye->rows[f], poses));
    std::vector<const Objects*> frames;
    for (const auto& o : objects) frames.push_back(&o);
    std::vector<Measurement> measured;
    for (std::size_t c = 0; c < front_ends.size() && ceiling; ++c) {
      const auto& row = data.ceiling[c].rows[f];
      const auto found = front_ends[c].process(row.time_ns, row.sequence, cv::imread(row.path));
      measured.insert(measured.end(), found.begin(), found.end());
    }
    std::vector<const Measurement*> measurements;
    for (const auto& m : measured) measurements.push_back(&m);
    poses = stage.process(objects[0].acquired_ns, frames, measurements);
    for (const auto& pose : poses) {
      const auto& path = truth.trajectories.at(pose.robot);
      EXPECT_TRUE(pose.valid);
      EXPECT_EQ(path[f].time_ns, pose.acquired_ns);
      const Pose2 e = path[f].map_from_base.inverse() * pose.map_from_base;
      const double m = e.translation().norm();
      errors.mean_m += m;
      ++count;
      errors.worst_m = std::max(errors.worst_m, m);
      errors.worst_rad = std::max(errors.worst_rad, std::abs(e.theta_rad));
      if (std::getenv("EACH") != nullptr) {
        std::printf("%s %2zu %6.2f %6.2f mm %6.3f deg (sigma %.2f mm) sightings %zu tracks %zu %s\n",
                    pose.robot.c_str(), f, 1e3 * e.x_m, 1e3 * e.y_m, e.theta_rad * 180 / M_PI,
                    1e3 * std::sqrt(pose.covariance(0, 0)), pose.sightings.size(),
                    objects[&pose - poses.data()].tracks.size(), stage.status(pose.robot).c_str());
      }
    }
  }
  stage.finish();
  errors.mean_m /= count;
  errors.landmarks = stage.estimator().landmarks();
  std::printf("path: mean %.3f cm, worst %.3f cm, %.3f deg\n", 100 * errors.mean_m, 100 * errors.worst_m,
              errors.worst_rad * 180 / M_PI);
  return errors;
}

class RecordedLine : public ::testing::Test {
 protected:
  void SetUp() override {
    if (!std::filesystem::exists(sampleFolder())) GTEST_SKIP() << "no " << sampleFolder();
    data_ = dataset::Dataset::open(sampleFolder());
  }
  dataset::Dataset data_;
};

TEST_F(RecordedLine, WithoutCeilingCameras) {
  estimation::EstimatorOptions wheels;
  wheels.use_landmarks = wheels.use_sightings = false;
  const Errors alone = replay(data_, wheels, false);
  const Errors all = replay(data_, {}, false);
  EXPECT_LT(all.mean_m, 0.01);
  EXPECT_LT(all.mean_m, alone.mean_m);
  for (const auto& landmark : all.landmarks) {
    std::printf("landmark %u at %.3f %.3f height %.3f +- %.3f, %d views\n", landmark.id,
                landmark.centre_m.x(), landmark.centre_m.y(), landmark.height_m, landmark.height_sigma_m,
                landmark.views);
  }
}

TEST_F(RecordedLine, WithCeilingCameras) {
  EXPECT_LT(replay(data_, {}, true).mean_m, 0.002);
}

}  // namespace
}  // namespace omnifleet::localizer
