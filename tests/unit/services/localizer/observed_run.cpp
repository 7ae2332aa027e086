#include "observed_run.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <set>

#include "dataset/observation_rows.h"
#include "evaluation/consistency.h"
#include "evaluation/trajectory_metrics.h"
#include "localizer/observation_frames.h"

namespace omnifleet::localizer::testing {
namespace {

using Report = ObservationFrames::Report;

/// All reports of a recording, ordered by time, then robot.
std::map<TimeNs, std::vector<Report>> reportsOf(const dataset::Dataset& recording) {
  std::map<TimeNs, std::vector<Report>> all;
  for (const auto& robot : recording.robots) {
    std::uint32_t sequence = 0;
    for (std::size_t i = 0; i < robot.observations.size();) {
      std::size_t end = i;
      while (end < robot.observations.size() &&
             robot.observations[end].time_ns == robot.observations[i].time_ns)
        ++end;
      all[robot.observations[i].time_ns].push_back(
          {robot.name, sequence++, dataset::measurementsOf(robot.name, &robot.observations[i], end - i, {})});
      i = end;
    }
  }
  return all;
}

std::vector<Measurement> surveyed(const dataset::Dataset& recording) {
  std::vector<Measurement> all;
  for (const auto& landmark : recording.landmarks) {
    Measurement m;
    m.kind = MeasurementKind::kPosition;
    m.to = landmark.name;
    m.value << landmark.position_m, 0.0;
    m.covariance = landmark.sigma_m * landmark.sigma_m * Eigen::Matrix3d::Identity();
    all.push_back(std::move(m));
  }
  return all;
}

}  // namespace

ObservedRun runObserved(const dataset::Dataset& recording, const ObservedRunOptions& options,
                        const std::map<std::string, std::vector<dataset::StampedPose>>& truth) {
  std::vector<estimation::RobotSetup> setups;
  std::set<std::string> names;
  bool tied = options.survey;
  for (const auto& robot : recording.robots) {
    setups.push_back({robot.name, robot.body, robot.initial_pose});
    names.insert(robot.name);
    tied = tied || robot.initial_pose;
  }
  if (!tied) {
    setups.front().initial_pose = Pose2{};
    setups.front().founds_map = true;
  }
  EstimatorStage stage(setups, options.estimator);
  ObservationFrames frames(names, {});
  std::vector<Measurement> survey = options.survey ? surveyed(recording) : std::vector<Measurement>{};
  std::map<std::string, std::size_t> next_row;
  std::map<std::string, int> counted;
  ObservedRun run;
  const auto all = reportsOf(recording);
  for (const auto& [time, reports] : all) {
    if (static_cast<double>(time - all.begin()->first) * 1e-9 > options.until_s) break;
    for (const auto& robot : recording.robots) {
      std::size_t& next = next_row[robot.name];
      for (; next < robot.wheels.size() && robot.wheels[next].time_ns < time; ++next) {
        const auto& row = robot.wheels[next];
        stage.addWheels(robot.name, row.time_ns, row.left_mps, row.right_mps);
      }
    }
    std::vector<const Measurement*> values;
    std::vector<const Report*> reported;
    for (const Measurement& m : survey) values.push_back(&m);
    for (const Report& report : reports) {
      reported.push_back(&report);
      for (const Measurement& m : report.values) values.push_back(&m);
    }
    std::vector<const Objects*> pointers;
    for (const Objects& frame : frames.framesAt(time, reported)) pointers.push_back(&frame);
    const auto poses = stage.process(time, pointers, values);
    survey.clear();
    for (std::size_t i = 0; i < reports.size(); ++i) {
      if (!poses[i].valid) continue;
      run.trajectories[poses[i].robot].push_back({time, poses[i].map_from_base});
      run.covariances[poses[i].robot].push_back({time, poses[i].covariance, poses[i].datum});
      Pose2 exact;
      const auto path = truth.find(poses[i].robot);
      if (path == truth.end() || !evaluation::poseAt(path->second, time, 1'000'000'000, exact)) continue;
      const Eigen::Vector3d e = evaluation::errorOf(poses[i].map_from_base, exact);
      run.nees[poses[i].robot] +=
          evaluation::normalisedSquare(poses[i].map_from_base, poses[i].covariance, exact);
      auto& parts = run.parts.try_emplace(poses[i].robot, Eigen::Vector3d::Zero()).first->second;
      parts += e.cwiseAbs2().cwiseQuotient(poses[i].covariance.diagonal());
      ++counted[poses[i].robot];
    }
    if (stage.refineDue()) stage.refine();
  }
  for (auto& [robot, sum] : run.nees) sum /= counted[robot];
  for (auto& [robot, sum] : run.parts) sum /= counted[robot];
  run.points = stage.estimator().points();
  for (const std::string& name : names) {
    run.wheels[name] = stage.estimator().wheelModel(name);
    run.detectors[name] = stage.estimator().detectorModel(name);
    run.status[name] = stage.estimator().status(name);
  }
  return run;
}

Pose2 alignToTruth(const ObservedRun& run,
                   const std::map<std::string, std::vector<dataset::StampedPose>>& truth) {
  std::vector<dataset::StampedPose3> from, to;
  for (const auto& [name, path] : run.trajectories) {
    for (const auto& pose : path) {
      Pose2 exact;
      if (!evaluation::poseAt(truth.at(name), pose.time_ns, 1'000'000'000, exact)) continue;
      from.push_back(evaluation::lift(pose));
      to.push_back(evaluation::lift(dataset::StampedPose{pose.time_ns, exact}));
    }
  }
  const auto fit = evaluation::align(from, to, evaluation::Alignment::kSe2, false);
  return {fit.translation.x(), fit.translation.y(), std::atan2(fit.rotation(1, 0), fit.rotation(0, 0))};
}

}  // namespace omnifleet::localizer::testing
