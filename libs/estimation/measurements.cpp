#include "estimation/measurements.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "estimation/factors.h"
#include "estimation/messages.h"
#include "estimation/point_alignment.h"
#include "estimation/starts.h"

namespace omnifleet::estimation {
namespace {

constexpr TimeNs kPatience_ns = 2000000000;
constexpr double kCauchy = 3.0;       // σ at which a measurement as a whole counts half
constexpr int kKidnapped = 3;         // absolute poses in a row, all refused, that move a robot
constexpr double kGate = 25.0;        // χ² of an absolute pose against the prediction (3 dof, 1.5e-5)
constexpr double kRangeCauchy = 2.0;  // likewise, of ranges and bearings
constexpr double kRangeGate = 20.0;   // χ² of a range and bearing against the prediction (2 dof, 5e-5)
constexpr double kRangeSlack_m = 0.08, kRangeSlack = 0.05,
                 kBearingSlack_rad = 0.04;  // σ of detectors' models
constexpr int kDisplaced = 8;  // ranges and bearings in a row, all refused, that tell a robot was moved
constexpr double kSlack_m2 = 4e-4, kSlack_rad2 = 3e-4;  // (2 cm)², (1°)²: models are never exact

const Objects* frameOf(const std::vector<const Objects*>& frames, const std::string& robot) {
  const auto at =
      std::find_if(frames.begin(), frames.end(), [&](const Objects* f) { return f->robot == robot; });
  return at == frames.end() ? nullptr : *at;
}

/// @param is_new the newest frame of the robot has come since its covariance was computed
double disagreement(const RobotNode& robot, const PoseAt& at, const Measurement& m, bool is_new) {
  const Pose2 difference = at.map_from_base.inverse() * Pose2::fromVector(m.value);
  Eigen::Matrix3d covariance = robot.covariance + m.covariance;
  const Step& step = robot.window.back();
  if (is_new && step.motion != kNoFactor)
    covariance = m.covariance +
                 composeCovariance(robot.covariance, step.previous_from_current, step.motion_covariance);
  covariance.diagonal() += Eigen::Vector3d(kSlack_m2, kSlack_m2, kSlack_rad2);
  const Eigen::Vector3d e = difference.vector();
  return e.dot(covariance.ldlt().solve(e));
}

/// Keeps an accepted absolute pose of the newest frame.
void noteFix(RobotNode& robot, const Measurement& m) {
  constexpr TimeNs kSame_ns = 1000000;  // as frames: closer times are the same
  if (std::abs(robot.window.back().time_ns - m.acquired_ns) > kSame_ns) return;
  const AbsoluteFix fix{Pose2::fromVector(m.value), m.covariance};
  robot.absolute_aid.fix = robot.absolute_aid.fix ? AbsoluteFix::fuse(*robot.absolute_aid.fix, fix) : fix;
}

/// In base_link at the time of the measurement.
Eigen::Vector2d inBase(const FleetState& fleet, const RobotNode& robot, const Measurement& m) {
  return fleet.seenFrom(robot, m.from_ns == 0 ? m.acquired_ns : m.from_ns, m.value.head<2>());
}

/// Of a robot's newest position, in its own axes.
Eigen::Matrix2d placeCovariance(const RobotNode& robot) {
  return robot.covariance.topLeftCorner<2, 2>();
}

/// The gate of a range and bearing against what is predicted; a robot none of whose sightings pass for a
/// while has been moved, and is located anew.
bool plausible(FleetState& fleet, const Measurement& m, RobotNode& robot, const PoseAt& from,
               const Eigen::Vector2d& target_m, const Eigen::Matrix2d& target_covariance) {
  const Eigen::Vector2d expected = from.map_from_base.inverse() * target_m;
  const double range = std::max(0.05, expected.norm());
  const Eigen::Vector2d along = expected / range, across(-along.y(), along.x());
  const Eigen::Vector2d off = inBase(fleet, robot, m) - expected;
  Eigen::Matrix<double, 2, 3> by_pose;
  by_pose << Eigen::Matrix2d::Identity(), Eigen::Vector2d(-expected.y(), expected.x());
  const Eigen::Matrix2d base_from_map = from.map_from_base.rotation().transpose();
  Eigen::Matrix2d covariance = by_pose * robot.covariance * by_pose.transpose() +
                               base_from_map * target_covariance * base_from_map.transpose();
  const double along_m = kRangeSlack_m + kRangeSlack * range, across_m = kBearingSlack_rad * range;
  covariance += (along_m * along_m + m.covariance(0, 0)) * along * along.transpose() +
                (across_m * across_m + range * range * m.covariance(1, 1)) * across * across.transpose();
  if (off.dot(covariance.ldlt().solve(off)) <= kRangeGate) {
    robot.absolute_aid.refusals = 0;
    robot.absolute_aid.refused.clear();
    return true;
  }
  ++robot.absolute_aid.refusals;
  robot.absolute_aid.refused.insert(m.to);
  if (robot.absolute_aid.refusals >= kDisplaced && robot.absolute_aid.refused.size() >= 2) {
    fleet.release(robot);
    robot.status.state = RobotState::kLost;
    robot.status.message = localizationLost();
    ++robot.status.losses;
  }
  return false;
}

Source sourceOf(const FleetState& fleet, const Measurement& m) {
  if (m.kind == MeasurementKind::kAbsolutePose || m.kind == MeasurementKind::kPosition)
    return Source::kAbsolute;
  return fleet.find(m.to) != nullptr ? Source::kSightings : Source::kLandmarks;
}

}  // namespace

void MeasurementQueue::attach(FleetState& fleet, TimeNs time, const std::vector<const Objects*>& frames) {
  std::deque<Measurement> still;
  for (const Measurement& measurement : waiting_) {
    const Outcome outcome = attachOne(fleet, measurement, frames);
    const Source source = sourceOf(fleet, measurement);
    if (outcome == Outcome::kDone) {
      for (const std::string* name : {&measurement.from, &measurement.to}) {
        RobotNode* robot = fleet.find(*name);
        if (robot == nullptr) continue;
        robot->track_aid.unobserved = 0;
        robot->absolute_aid.used.add(source);
        if (source == Source::kAbsolute) robot->absolute_aid.accepted = true;
      }
      continue;
    }
    const bool old = time - measurement.acquired_ns > kPatience_ns;
    if (outcome == Outcome::kWait && !old) {
      still.push_back(measurement);
      continue;
    }
    RobotNode* robot = fleet.find(measurement.from.empty() ? measurement.to : measurement.from);
    if (robot == nullptr) continue;
    ++robot->status.rejected_measurements;
    if (outcome == Outcome::kRejected) robot->absolute_aid.rejected.add(source);
  }
  waiting_.swap(still);
}

MeasurementQueue::Outcome MeasurementQueue::attachOne(FleetState& fleet, const Measurement& m,
                                                      const std::vector<const Objects*>& frames) {
  switch (m.kind) {
    case MeasurementKind::kAbsolutePose:
    case MeasurementKind::kPosition:
      return attachAbsolute(fleet, m, frames);
    case MeasurementKind::kRelativePose:
    case MeasurementKind::kRangeBearing:
      return attachRelative(fleet, m);
  }
  return Outcome::kRejected;
}

MeasurementQueue::Outcome MeasurementQueue::attachAbsolute(FleetState& fleet, const Measurement& m,
                                                           const std::vector<const Objects*>& frames) {
  RobotNode* robot = fleet.find(m.to);
  const Eigen::Matrix2d position_covariance = m.covariance.topLeftCorner<2, 2>();
  if (robot == nullptr) {  // a known landmark
    if (m.kind != MeasurementKind::kPosition) return Outcome::kRejected;
    Point& point = fleet.points[m.to];
    if (point.surveyed) return Outcome::kRejected;  // nothing counts twice
    if (point.variable == 0) point.variable = fleet.graph.addVariable(m.value.head<2>());
    point.surveyed = true;
    point.covariance = position_covariance;
    const Eigen::Vector2d sigma = position_covariance.diagonal().cwiseSqrt();
    fleet.graph.addFactor(priorFactor(m.value.head<2>(), sigma), {point.variable});
    return Outcome::kDone;
  }
  fleet.tied = true;
  const bool whole = m.kind == MeasurementKind::kAbsolutePose;
  const Pose2 measured = Pose2::fromVector(m.value);
  const Objects* frame = frameOf(frames, m.to);
  if (!robot->located()) {
    if (frame == nullptr || frame->acquired_ns < m.acquired_ns || !whole) return Outcome::kWait;
    fleet.place(*robot, *frame, measured);
    const auto at = fleet.poseAt(*robot, m.acquired_ns);
    if (!at) {  // older than the step to this frame: not usable after all
      fleet.release(*robot);
      return Outcome::kRejected;
    }
    fleet.graph.value(at->pose) = (measured * at->offset.inverse()).vector();
    Eigen::Matrix3d covariance = m.covariance;
    if (!frame->motion.valid)  // it may have driven since
      covariance += fleet.unknownMotion(1e-9 * static_cast<double>(frame->acquired_ns - m.acquired_ns));
    fleet.graph.addFactor(absolutePoseFactor(measured, covariance, at->offset), {at->pose});
    noteFix(*robot, m);
    return Outcome::kDone;
  }
  if (robot->window.back().time_ns < m.acquired_ns) return Outcome::kWait;
  const auto at = fleet.poseAt(*robot, m.acquired_ns);
  if (!at) return Outcome::kRejected;
  if (!whole) {
    fleet.graph.addFactor(absolutePositionFactor(m.value.head<2>(), position_covariance, at->offset),
                          {at->pose}, kCauchy);
    return Outcome::kDone;
  }
  if (disagreement(*robot, *at, m, frame != nullptr) > kGate) {
    if (++robot->absolute_aid.disagreements < kKidnapped || frame == nullptr) return Outcome::kRejected;
    if (isOpen(robot->start)) {
      moveStart(fleet, *robot, measured * at->map_from_base.inverse(), m.covariance);
      robot->absolute_aid.disagreements = 0;
      return Outcome::kDone;
    }
    fleet.release(*robot);
    ++robot->status.losses;
    return attachAbsolute(fleet, m, frames);
  }
  robot->absolute_aid.disagreements = 0;
  robot->start.borne_out = true;
  fleet.graph.addFactor(absolutePoseFactor(measured, m.covariance, at->offset), {at->pose}, kCauchy);
  noteFix(*robot, m);
  return Outcome::kDone;
}

MeasurementQueue::Outcome MeasurementQueue::attachRelative(FleetState& fleet, const Measurement& m) {
  RobotNode* from = fleet.find(m.from);
  RobotNode* to = fleet.find(m.to);
  const bool range_bearing = m.kind == MeasurementKind::kRangeBearing;
  if (from == nullptr || (to == nullptr && !range_bearing)) return Outcome::kRejected;
  const TimeNs from_ns = range_bearing && m.from_ns == 0 ? m.acquired_ns : m.from_ns;
  if (range_bearing && attachToScout(fleet, m, from_ns, *from, to)) return Outcome::kDone;
  if (!from->located() || from->window.back().time_ns < from_ns) return Outcome::kWait;
  const auto from_at = fleet.poseAt(*from, from_ns);
  if (!from_at) return Outcome::kRejected;
  if (to == nullptr) return attachToPoint(fleet, m, *from, *from_at);
  if (!to->located() || to->window.back().time_ns < m.acquired_ns) return Outcome::kWait;
  const auto to_at = fleet.poseAt(*to, m.acquired_ns);
  if (!to_at || to_at->pose == from_at->pose) return Outcome::kRejected;
  if (!range_bearing) {
    fleet.graph.addFactor(
        relativePoseFactor(Pose2::fromVector(m.value), m.covariance, from_at->offset, to_at->offset),
        {from_at->pose, to_at->pose}, kCauchy);
    return Outcome::kDone;
  }
  const Eigen::Matrix2d rotation = to_at->map_from_base.rotation();
  const Eigen::Matrix2d covariance = rotation * to->covariance.topLeftCorner<2, 2>() * rotation.transpose();
  if (!plausible(fleet, m, *from, *from_at, to_at->map_from_base.translation(), covariance))
    return Outcome::kRejected;
  const RangeBearingSight sight{m.value.head<2>(), m.covariance.topLeftCorner<2, 2>(), from_at->offset,
                                fleet.twistAt(*from, from_ns)};
  fleet.graph.addFactor(rangeBearingPoseFactor(sight, to_at->offset),
                        {from_at->pose, to_at->pose, fleet.detector(*from)}, kRangeCauchy);
  return Outcome::kDone;
}

MeasurementQueue::Outcome MeasurementQueue::attachToPoint(FleetState& fleet, const Measurement& m,
                                                          RobotNode& robot, const PoseAt& from) {
  const VariableId detector = fleet.detector(robot);
  auto at = fleet.points.find(m.to);
  if (at == fleet.points.end()) {
    if (robot.absolute_aid.refusals > 0)
      return Outcome::kRejected;  // founds nothing while its place is in doubt
    at = fleet.points.emplace(m.to, Point{}).first;
    at->second.variable = fleet.graph.addVariable(from.map_from_base * inBase(fleet, robot, m));
  } else if (!plausible(fleet, m, robot, from, fleet.graph.value(at->second.variable),
                        at->second.covariance)) {
    return Outcome::kRejected;
  }
  fleet.tied = fleet.tied || at->second.surveyed;
  ++at->second.views;
  at->second.last_seen_ns = m.acquired_ns;
  const RangeBearingSight sight{m.value.head<2>(), m.covariance.topLeftCorner<2, 2>(), from.offset,
                                fleet.twistAt(robot, m.from_ns == 0 ? m.acquired_ns : m.from_ns)};
  fleet.graph.addFactor(rangeBearingPointFactor(sight), {from.pose, at->second.variable, detector},
                        kRangeCauchy);
  return Outcome::kDone;
}

bool MeasurementQueue::attachToScout(const FleetState& fleet, const Measurement& m, TimeNs from_ns,
                                     RobotNode& from, RobotNode* to) {
  if (!from.located()) {
    if (!from.scout || from.scout->time_ns != from_ns) return false;
    const Eigen::Vector2d seen = from.scout->local_from_base * inBase(fleet, from, m);
    const auto point = fleet.points.find(m.to);
    const auto peer = to == nullptr ? std::nullopt : fleet.poseAt(*to, m.acquired_ns);
    if (peer) addScoutPair(from, m.to, seen, peer->map_from_base.translation(), placeCovariance(*to));
    if (point != fleet.points.end())
      addScoutPair(from, m.to, seen, fleet.graph.value(point->second.variable), point->second.covariance);
    return true;
  }
  if (to == nullptr || to->located() || !to->scout || to->scout->time_ns != m.acquired_ns) return false;
  if (const auto at = fleet.poseAt(from, from_ns)) {
    const Eigen::Vector2d seen = inBase(fleet, from, m);
    Eigen::Matrix<double, 2, 3> by_pose;
    by_pose << Eigen::Matrix2d::Identity(), Eigen::Vector2d(-seen.y(), seen.x());
    addScoutPair(*to, m.from, to->scout->local_from_base.translation(), at->map_from_base * seen,
                 by_pose * from.covariance * by_pose.transpose());
  }
  return true;
}

}  // namespace omnifleet::estimation
