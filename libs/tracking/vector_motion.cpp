#include "tracking/vector_motion.h"

#include <cmath>

namespace omnifleet::tracking {
namespace {

constexpr int kFewest = 4;
constexpr double kStanding_m = 0.004;    // m, step of the robot below which directions are not meaningful
constexpr double kOpposite = 0.7;        // cosine: within 45° of −t
constexpr double kLargeMagnitude = 0.6;  // share of the own step; a static point shows at least 1

/// Translation of the camera's foot in the axes of the current base_link.
Eigen::Vector2d footTranslation(const Motion& motion, const Eigen::Vector2d& foot_m) {
  const Pose2& previous_from_current = motion.previous_from_current;
  return previous_from_current.rotation().transpose() * (previous_from_current * foot_m - foot_m);
}

}  // namespace

VectorMotion vectorMotion(const ObjectObservation& object, const Motion& motion,
                          const Eigen::Vector2d& foot_m, double tolerance_m) {
  VectorMotion result;
  if (!motion.valid) return result;
  const Eigen::Vector2d t = footTranslation(motion, foot_m);
  const double length = t.norm();
  const Eigen::Vector2d along = length > 1e-9 ? Eigen::Vector2d(t / length) : Eigen::Vector2d::UnitX();
  int moving = 0;
  for (const FlowVector& vector : object.vectors) {
    const Eigen::Vector2d residual = vector.residual_m.cast<double>();
    if (!residual.allFinite()) continue;
    const double with = residual.dot(along),
                 across = std::abs(residual.dot(Eigen::Vector2d(-along.y(), along.x())));
    const bool standing = length < kStanding_m;
    if (standing ? residual.norm() > tolerance_m : with > tolerance_m || across > tolerance_m) ++moving;
    result.mean_m += residual - t;
    ++result.count;
  }
  if (result.count < kFewest) return result;
  result.mean_m /= result.count;
  result.moving_share = static_cast<double>(moving) / result.count;
  result.valid = true;
  return result;
}

ObjectKind kindByVectors(const VectorMotion& vectors, const Motion& motion) {
  const Eigen::Vector2d t = motion.previous_from_current.translation();
  if (!vectors.valid || t.norm() < kStanding_m) return ObjectKind::kUnknown;
  const Eigen::Vector2d forward = motion.previous_from_current.rotation().transpose() * t / t.norm();
  const double magnitude = vectors.mean_m.norm();
  const bool opposite = -vectors.mean_m.dot(forward) > kOpposite * magnitude;
  return opposite && magnitude > kLargeMagnitude * t.norm() ? ObjectKind::kObstacle : ObjectKind::kRobot;
}

}  // namespace omnifleet::tracking
