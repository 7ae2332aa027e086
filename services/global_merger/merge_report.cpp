#include "global_merger/merge_report.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace omnifleet::global_merger {
namespace {

std::string nameOfFrame(const std::string& frame) {
  return frame.empty() ? dataset::RobotMerge::kMap : frame;
}

/// σ of the position along its larger axis, m, and of the heading, rad.
Eigen::Vector2d relationSigmaOf(const Eigen::Matrix3d& covariance) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(Eigen::Matrix2d(covariance.topLeftCorner<2, 2>()),
                                                            Eigen::EigenvaluesOnly);
  return Eigen::Vector2d(axes.eigenvalues()(1), covariance(2, 2)).cwiseMax(0.0).cwiseSqrt();
}

dataset::RobotMerge reported(const Alignment& alignment) {
  dataset::RobotMerge robot;
  robot.status = alignment.status;
  robot.frame = nameOfFrame(alignment.frame);
  robot.reason = alignment.reason;
  robot.score = alignment.score;
  robot.time_s = static_cast<double>(alignment.acquired_ns) / 1e9;
  if (alignment.status == AlignmentStatus::kMatched) {
    robot.map_from_frame = alignment.map_from_frame;
    robot.sigma = relationSigmaOf(alignment.covariance);
  }
  return robot;
}

dataset::RobotMerge unreported(const std::string& name, const Merger& common) {
  dataset::RobotMerge robot;
  const auto frame = common.frameOf(name);
  if (frame) robot.frame = nameOfFrame(*frame);
  const bool has_samples =
      common.map().store().find(name) != nullptr || common.localization().count(name) > 0;
  if (!frame) {
    robot.reason = has_samples ? "the robot has no valid pose" : "no sample of this robot was received";
  } else if (robot.isInMap()) {
    robot.status = AlignmentStatus::kAnchored;
    robot.reason = "assumed: its poses are in map; the localizer reported no alignment";
  } else {
    robot.reason = "its poses are in its own frame; the localizer reported no alignment";
  }
  return robot;
}

}  // namespace

dataset::MergeReport mergeReport(const std::vector<std::string>& robots,
                                 const std::map<std::string, Alignment>& alignments, const Merger& common) {
  dataset::MergeReport report;
  for (const std::string& robot : robots) {
    const auto alignment = alignments.find(robot);
    report[robot] = alignment == alignments.end() ? unreported(robot, common) : reported(alignment->second);
  }
  return report;
}

}  // namespace omnifleet::global_merger
