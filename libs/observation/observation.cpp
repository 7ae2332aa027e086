#include "observation/observation.h"

namespace omnifleet {

const char* toString(FrameState state) {
  switch (state) {
    case FrameState::kOk:
      return "ok";
    case FrameState::kMissing:
      return "missing";
    case FrameState::kUnreadable:
      return "unreadable";
    case FrameState::kWrongSize:
      return "wrong size";
    case FrameState::kEmpty:
      return "empty";
    case FrameState::kNonFinite:
      return "non-finite number";
    case FrameState::kDark:
      return "dark";
    case FrameState::kOverexposed:
      return "overexposed";
    case FrameState::kTorn:
      return "torn";
    case FrameState::kOutOfOrder:
      return "out of order";
  }
  return "?";
}

const char* toString(ObjectKind kind) {
  switch (kind) {
    case ObjectKind::kUnknown:
      return "unknown";
    case ObjectKind::kObstacle:
      return "obstacle";
    case ObjectKind::kRobot:
      return "robot";
  }
  return "?";
}

const char* toString(AlignmentStatus status) {
  switch (status) {
    case AlignmentStatus::kAnchored:
      return "anchored";
    case AlignmentStatus::kMatched:
      return "matched";
    case AlignmentStatus::kRefused:
      return "refused";
    case AlignmentStatus::kUndecided:
      break;
  }
  return "undecided";
}

const char* toString(LocalizationState state) {
  switch (state) {
    case LocalizationState::kUnlocated:
      return "unlocated";
    case LocalizationState::kLocalized:
      return "localized";
    case LocalizationState::kOdometryOnly:
      return "odometry_only";
    case LocalizationState::kLost:
      return "lost";
    case LocalizationState::kRelocalized:
      return "relocalized";
  }
  return "?";
}

const char* toString(PoseEvent event) {
  switch (event) {
    case PoseEvent::kNone:
      return "none";
    case PoseEvent::kRelocalized:
      return "relocalized";
    case PoseEvent::kLoopClosed:
      return "loop_closed";
    case PoseEvent::kAbsolute:
      return "absolute";
    case PoseEvent::kCorrected:
      return "corrected";
    case PoseEvent::kGap:
      return "gap";
  }
  return "?";
}

Polygon RobotBody::outline() const {
  return footprint_m.size() >= 3 ? footprint_m : circlePolygon(Eigen::Vector2d::Zero(), radius_m, 48);
}

}  // namespace omnifleet
