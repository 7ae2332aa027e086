#include "localizer/estimator_stage.h"

#include <Eigen/Dense>
#include <utility>

namespace omnifleet::localizer {
namespace {

/// Number of the leading entries of value and covariance that a kind uses.
Eigen::Index dimension(MeasurementKind kind) {
  return kind == MeasurementKind::kAbsolutePose || kind == MeasurementKind::kRelativePose ? 3 : 2;
}

bool positiveDefinite(const Eigen::MatrixXd& covariance) {
  const Eigen::LLT<Eigen::MatrixXd> llt(covariance);
  return llt.info() == Eigen::Success && covariance.isApprox(covariance.transpose(), 1e-6);
}

}  // namespace

EstimatorStage::EstimatorStage(std::vector<estimation::RobotSetup> robots,
                               const estimation::EstimatorOptions& options)
    : estimator_(robots, options) {
  for (const auto& robot : robots) robots_.insert(robot.name);
}

bool EstimatorStage::usable(const Measurement& m) const {
  const Eigen::Index n = dimension(m.kind);
  if (!m.value.head(n).allFinite() || !m.covariance.topLeftCorner(n, n).allFinite()) return false;
  if (!positiveDefinite(m.covariance.topLeftCorner(n, n))) return false;
  switch (m.kind) {
    case MeasurementKind::kAbsolutePose:
      return robots_.count(m.to) > 0;
    case MeasurementKind::kPosition:
      return !m.to.empty();
    case MeasurementKind::kRelativePose:
      return robots_.count(m.from) > 0 && robots_.count(m.to) > 0;
    case MeasurementKind::kRangeBearing:
      return robots_.count(m.from) > 0 && !m.to.empty() && m.value.x() > 0;
  }
  return false;
}

std::vector<PoseEstimate> EstimatorStage::process(TimeNs time, const std::vector<const Objects*>& frames,
                                                  const std::vector<const Measurement*>& measurements) {
  known_.clear();
  usable_.clear();
  for (const Objects* frame : frames) {
    if (robots_.count(frame->robot) > 0) known_.push_back(frame);
  }
  for (const Measurement* measurement : measurements) {
    if (usable(*measurement)) usable_.push_back(measurement);
  }
  rejected_frames_ += frames.size() - known_.size();
  rejected_measurements_ += measurements.size() - usable_.size();
  std::vector<PoseEstimate> estimated = estimator_.process(time, known_, usable_);

  std::vector<PoseEstimate> all;
  std::size_t next = 0;
  for (const Objects* frame : frames) {
    if (next < known_.size() && known_[next] == frame) {
      all.push_back(std::move(estimated[next++]));
      continue;
    }
    PoseEstimate unknown;
    unknown.robot = frame->robot;
    unknown.acquired_ns = frame->acquired_ns;
    unknown.sequence = frame->sequence;
    all.push_back(std::move(unknown));
  }
  return all;
}

Message EstimatorStage::status(const std::string& robot) const {
  if (robots_.count(robot) == 0)
    return {ErrorCode::kNotLocalized,
            "this robot is not in the fleet file; its observations are ignored. Add it"};
  return estimator_.status(robot).message;
}

}  // namespace omnifleet::localizer
