#include "recorded_line.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <memory>
#include <opencv2/imgcodecs.hpp>
#include <set>

#include "classifier/classifier.h"
#include "evaluation/consistency.h"
#include "local_mapper/local_mapper.h"
#include "localizer/ceiling_front_end.h"
#include "motion/wheel_integrator.h"

namespace omnifleet::localizer::testing {
namespace {

struct RobotPipeline {
  const dataset::RobotRecording* recording;
  std::unique_ptr<local_mapper::LocalMapper> mapper;
  std::unique_ptr<classifier::Classifier> classifier;
  motion::WheelIntegrator wheels;
};

std::vector<RobotPipeline> openPipelines(const dataset::Dataset& data) {
  std::map<std::string, RobotBody> bodies;
  for (const auto& robot : data.robots) bodies[robot.name] = robot.body;
  std::vector<RobotPipeline> pipelines;
  for (const auto& robot : data.robots) {
    RobotPipeline pipeline;
    pipeline.recording = &robot;
    pipeline.mapper = std::make_unique<local_mapper::LocalMapper>(lens::Camera(robot.fisheye->camera),
                                                                  local_mapper::Options());
    pipeline.classifier =
        std::make_unique<classifier::Classifier>(classifier::Classifier::Options(), robot.name, bodies);
    pipeline.wheels = motion::WheelIntegrator(robot.body.wheel_separation_m, {});
    for (const auto& row : robot.wheels) pipeline.wheels.add(row.time_ns, row.left_mps, row.right_mps);
    pipelines.push_back(std::move(pipeline));
  }
  return pipelines;
}

Objects observe(RobotPipeline& pipeline, const dataset::ImageRow& row,
                const std::vector<PoseEstimate>& previous) {
  local_mapper::Frame frame;
  frame.acquired_ns = row.time_ns;
  frame.sequence = row.sequence;
  frame.image = cv::imread(row.path);
  LocalMap map = pipeline.mapper->process(frame, pipeline.wheels.motionTo(row.time_ns));
  map.robot = pipeline.recording->name;
  return pipeline.classifier->process(map, previous);
}

const dataset::ImageRow* rowAt(const std::vector<dataset::ImageRow>& rows, TimeNs time_ns) {
  const auto at = std::find_if(rows.begin(), rows.end(),
                               [&](const dataset::ImageRow& row) { return row.time_ns == time_ns; });
  return at == rows.end() ? nullptr : &*at;
}

/// The estimator, with an evaluation of its poses against the truth.
class EvaluatedEstimator {
 public:
  EvaluatedEstimator(const dataset::Dataset& data, const estimation::EstimatorOptions& options,
                     const Truth& truth)
      : stage_(setups(data), options), truth_(truth) {}

  const std::vector<PoseEstimate>& process(const RecordedTime& time) {
    std::vector<const Objects*> frames;
    std::vector<const Measurement*> measurements;
    for (const auto& objects : time.frames) frames.push_back(&objects);
    for (const auto& m : time.measurements) measurements.push_back(&m);
    if (frames.empty()) return poses_;
    poses_ = stage_.process(frames.front()->acquired_ns, frames, measurements);
    for (const auto& pose : poses_) compare(pose);
    return poses_;
  }

  RecordedRun finish() {
    stage_.finish();
    const double n = std::max(1, run_.poses);
    run_.mean_m /= n;
    run_.nees /= n;
    run_.heading_nees /= n;
    run_.landmarks = stage_.estimator().landmarks();
    for (const auto& [robot, path] : truth_) run_.cameras[robot] = stage_.estimator().cameraError(robot);
    return run_;
  }

 private:
  static std::vector<estimation::RobotSetup> setups(const dataset::Dataset& data) {
    std::vector<estimation::RobotSetup> all;
    for (const auto& robot : data.robots) {
      all.push_back({robot.name, robot.body, robot.initial_pose});
      if (robot.fisheye) all.back().lens = lens::Spread::of(lens::Camera(robot.fisheye->camera));
    }
    return all;
  }

  void compare(const PoseEstimate& pose) {
    const auto& path = truth_.at(pose.robot);
    const auto exact =
        std::find_if(path.begin(), path.end(), [&](const auto& p) { return p.time_ns == pose.acquired_ns; });
    if (exact == path.end()) return;
    if (!pose.valid) {
      ++run_.invalid;
      return;
    }
    const Pose2 e = pose.map_from_base.inverse() * exact->map_from_base;
    run_.mean_m += e.translation().norm();
    run_.worst_m = std::max(run_.worst_m, e.translation().norm());
    run_.worst_rad = std::max(run_.worst_rad, std::abs(e.theta_rad));
    const double nees =
        evaluation::normalisedSquare(pose.map_from_base, pose.covariance, exact->map_from_base);
    run_.nees += nees;
    run_.compared.push_back({pose, e, nees});
    run_.heading_nees += e.theta_rad * e.theta_rad / pose.covariance(2, 2);
    ++run_.poses;
  }

  EstimatorStage stage_;
  const Truth& truth_;
  std::vector<PoseEstimate> poses_;
  RecordedRun run_;
};

}  // namespace

RecordedRun runRecorded(const dataset::Dataset& data, const estimation::EstimatorOptions& options,
                        bool ceiling, const Truth& truth, std::vector<RecordedTime>* times) {
  EvaluatedEstimator estimator(data, options, truth);
  std::vector<RobotPipeline> pipelines = openPipelines(data);
  std::vector<CeilingFrontEnd> front_ends;
  for (const auto& stream : data.ceiling)
    front_ends.emplace_back(stream.name, stream.camera, *data.markers, markers::FinderOptions());
  std::vector<PoseEstimate> poses;
  std::set<TimeNs> when;
  for (const auto& robot : data.robots)
    for (const auto& row : robot.fisheye->rows) when.insert(row.time_ns);
  for (const TimeNs now : when) {
    RecordedTime time;
    for (RobotPipeline& pipeline : pipelines) {
      const dataset::ImageRow* row = rowAt(pipeline.recording->fisheye->rows, now);
      if (row != nullptr) time.frames.push_back(observe(pipeline, *row, poses));
    }
    for (std::size_t c = 0; c < front_ends.size() && ceiling; ++c) {
      const dataset::ImageRow* row = rowAt(data.ceiling[c].rows, now);
      if (row == nullptr) continue;
      const auto found = front_ends[c].process(row->time_ns, row->sequence, cv::imread(row->path));
      time.measurements.insert(time.measurements.end(), found.begin(), found.end());
    }
    poses = estimator.process(time);
    if (times != nullptr) times->push_back(std::move(time));
  }
  return estimator.finish();
}

RecordedRun runFrames(const dataset::Dataset& data, const std::vector<RecordedTime>& times,
                      const estimation::EstimatorOptions& options, const Truth& truth) {
  EvaluatedEstimator estimator(data, options, truth);
  for (const RecordedTime& time : times) estimator.process(time);
  return estimator.finish();
}

}  // namespace omnifleet::localizer::testing
