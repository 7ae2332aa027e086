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
                               const estimation::EstimatorOptions& options,
                               const std::map<std::string, Pose2>& own_frames)
    : estimator_(robots, options), own_frames_(robots, own_frames, options) {
  for (const auto& robot : robots) {
    robots_.insert(robot.name);
    if (own_frames_.has(robot.name)) {
      estimator_.allowSightings(robot.name, false);  // until OwnFrames knows whether it has scans
      continue;
    }
    anchors_[robot.name] = robot.founds_map     ? "its first pose defines map"
                           : robot.initial_pose ? "initial pose"
                                                : "measurements of its pose, or of what it sees";
  }
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
  newest_ns_ = time;
  std::vector<PoseEstimate> estimated = estimator_.process(time, known_, usable_);

  std::vector<PoseEstimate> all;
  std::size_t next = 0;
  for (const Objects* frame : frames) {
    if (next < known_.size() && known_[next] == frame) {
      const PoseEstimate& common = estimated[next++];
      all.push_back(own_frames_.has(frame->robot) ? inOwnFrame(time, *frame, common) : common);
      noteAnchored(all.back());
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

/// A robot that the common estimator does not know the place of.
PoseEstimate EstimatorStage::inOwnFrame(TimeNs time, const Objects& frame, const PoseEstimate& common) {
  PoseEstimate own = own_frames_.process(time, frame);
  if (!common.valid) return own;
  own_frames_.giveUp(frame.robot, estimator_, time);
  return common;
}

void EstimatorStage::noteAnchored(const PoseEstimate& pose) {
  const auto anchor = anchors_.find(pose.robot);
  if (anchor == anchors_.end() || !pose.valid || !pose.frame.empty()) return;
  Alignment alignment;
  alignment.robot = pose.robot;
  alignment.acquired_ns = pose.acquired_ns;
  alignment.status = AlignmentStatus::kAnchored;
  alignment.reason = anchor->second;
  alignment.score = 1.0;
  anchored_.push_back(std::move(alignment));
  anchors_.erase(anchor);
}

void EstimatorStage::refine() {
  if (estimator_.refineDue()) estimator_.refine();
  if (own_frames_.refineDue()) own_frames_.refine(estimator_, newest_ns_);
}

std::vector<PoseEstimate> EstimatorStage::finish() {
  std::vector<PoseEstimate> all = estimator_.finish();
  for (PoseEstimate& pose : own_frames_.finish()) all.push_back(std::move(pose));
  return all;
}

std::vector<PoseEstimate> EstimatorStage::takeRevised() {
  std::vector<PoseEstimate> all = own_frames_.takeRevised();
  for (PoseEstimate& pose : estimator_.takeRevised()) all.push_back(std::move(pose));
  return all;
}

std::vector<Message> EstimatorStage::takeFindings() {
  std::vector<Message> all = own_frames_.takeFindings();
  for (Message& finding : estimator_.takeFindings()) all.push_back(std::move(finding));
  return all;
}

std::vector<Place> EstimatorStage::takePlaces() {
  std::vector<Place> all = own_frames_.takePlaces();
  for (Place& place : estimator_.takePlaces()) all.push_back(std::move(place));
  return all;
}

void EstimatorStage::keepAlignments(const std::set<std::string>& robots) {
  for (const std::string& robot : robots) anchors_.erase(robot);
}

std::vector<Alignment> EstimatorStage::takeAlignments() {
  std::vector<Alignment> all = std::exchange(anchored_, {});
  for (Alignment& alignment : own_frames_.takeAlignments()) all.push_back(std::move(alignment));
  return all;
}

Message EstimatorStage::status(const std::string& robot) const {
  if (robots_.count(robot) == 0)
    return {ErrorCode::kNotLocalized,
            "this robot is not in the fleet file; its observations are ignored. Add it"};
  return own_frames_.has(robot) ? own_frames_.status(robot).message : estimator_.status(robot).message;
}

}  // namespace omnifleet::localizer
