#include "estimation/measurements.h"

#include <Eigen/Dense>
#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr TimeNs kPatience_ns = 2000000000;
constexpr double kCauchy = 3.0;  // σ at which a measurement as a whole counts half
constexpr int kKidnapped = 3;    // absolute poses in a row, all refused, that move a robot
constexpr double kGate = 25.0;   // χ² of an absolute pose against the prediction (3 dof, 1.5e-5)
constexpr double kSlack_m2 = 4e-4, kSlack_rad2 = 3e-4;  // (2 cm)², (1°)²: models are never exact

const Objects* frameOf(const std::vector<const Objects*>& frames, const std::string& robot) {
  const auto at =
      std::find_if(frames.begin(), frames.end(), [&](const Objects* f) { return f->robot == robot; });
  return at == frames.end() ? nullptr : *at;
}

double disagreement(const RobotNode& robot, const PoseAt& at, const Measurement& m) {
  const Pose2 difference = at.map_from_base.inverse() * Pose2::fromVector(m.value);
  Eigen::Matrix3d covariance = robot.covariance + m.covariance;
  covariance.diagonal() += Eigen::Vector3d(kSlack_m2, kSlack_m2, kSlack_rad2);
  const Eigen::Vector3d e = difference.vector();
  return e.dot(covariance.ldlt().solve(e));
}

}  // namespace

void MeasurementQueue::attach(FleetState& fleet, TimeNs time, const std::vector<const Objects*>& frames) {
  std::deque<Measurement> still;
  for (const Measurement& measurement : waiting_) {
    const Outcome outcome = attachOne(fleet, measurement, frames);
    if (outcome == Outcome::kDone) continue;
    const bool old = time - measurement.acquired_ns > kPatience_ns;
    if (outcome == Outcome::kWait && !old) {
      still.push_back(measurement);
      continue;
    }
    RobotNode* robot = fleet.find(measurement.from.empty() ? measurement.to : measurement.from);
    if (robot != nullptr) ++robot->status.rejected_measurements;
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
    auto [at, fresh] = fleet.points.try_emplace(m.to, 0);
    if (fresh) at->second = fleet.graph.addVariable(m.value.head<2>());
    const Eigen::Vector2d sigma = position_covariance.diagonal().cwiseSqrt();
    fleet.graph.addFactor(priorFactor(m.value.head<2>(), sigma), {at->second});
    return Outcome::kDone;
  }
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
    fleet.graph.addFactor(absolutePoseFactor(measured, m.covariance, at->offset), {at->pose});
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
  if (disagreement(*robot, *at, m) > kGate) {
    if (++robot->disagreements < kKidnapped || frame == nullptr) return Outcome::kRejected;
    fleet.release(*robot);
    ++robot->status.losses;
    return attachAbsolute(fleet, m, frames);
  }
  robot->disagreements = 0;
  fleet.graph.addFactor(absolutePoseFactor(measured, m.covariance, at->offset), {at->pose}, kCauchy);
  return Outcome::kDone;
}

MeasurementQueue::Outcome MeasurementQueue::attachRelative(FleetState& fleet, const Measurement& m) {
  const RobotNode* from = fleet.find(m.from);
  const RobotNode* to = fleet.find(m.to);
  const bool range_bearing = m.kind == MeasurementKind::kRangeBearing;
  if (from == nullptr || (to == nullptr && !range_bearing)) return Outcome::kRejected;
  const TimeNs from_ns = range_bearing && m.from_ns == 0 ? m.acquired_ns : m.from_ns;
  if (!from->located() || from->window.back().time_ns < from_ns) return Outcome::kWait;
  const auto from_at = fleet.poseAt(*from, from_ns);
  if (!from_at) return Outcome::kRejected;
  if (to == nullptr) return attachToPoint(fleet, m, *from_at);
  if (!to->located() || to->window.back().time_ns < m.acquired_ns) return Outcome::kWait;
  const auto to_at = fleet.poseAt(*to, m.acquired_ns);
  if (!to_at || to_at->pose == from_at->pose) return Outcome::kRejected;
  auto factor = range_bearing ? rangeBearingPoseFactor(m.value.head<2>(), m.covariance.topLeftCorner<2, 2>(),
                                                       from_at->offset, to_at->offset)
                              : relativePoseFactor(Pose2::fromVector(m.value), m.covariance, from_at->offset,
                                                   to_at->offset);
  fleet.graph.addFactor(std::move(factor), {from_at->pose, to_at->pose}, kCauchy);
  return Outcome::kDone;
}

MeasurementQueue::Outcome MeasurementQueue::attachToPoint(FleetState& fleet, const Measurement& m,
                                                          const PoseAt& from) {
  auto [at, fresh] = fleet.points.try_emplace(m.to, 0);
  if (fresh) {
    const Eigen::Vector2d in_base(m.value.x() * std::cos(m.value.y()), m.value.x() * std::sin(m.value.y()));
    at->second = fleet.graph.addVariable(from.map_from_base * in_base);
  }
  fleet.graph.addFactor(
      rangeBearingPointFactor(m.value.head<2>(), m.covariance.topLeftCorner<2, 2>(), from.offset),
      {from.pose, at->second}, kCauchy);
  return Outcome::kDone;
}

}  // namespace omnifleet::estimation
