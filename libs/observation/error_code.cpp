#include "observation/error_code.h"

namespace omnifleet {

const char* toString(ErrorCode code) {
  switch (code) {
    case ErrorCode::kNone:
      return "";
    case ErrorCode::kSampleRejected:
      return "sample_rejected";
    case ErrorCode::kSampleOutOfOrder:
      return "sample_out_of_order";
    case ErrorCode::kFrameOverwritten:
      return "frame_overwritten";
    case ErrorCode::kStreamSilent:
      return "stream_silent";
    case ErrorCode::kRowsRejected:
      return "rows_rejected";
    case ErrorCode::kClockJump:
      return "clock_jump";
    case ErrorCode::kClockOffset:
      return "clock_offset";
    case ErrorCode::kWriteFailed:
      return "write_failed";
    case ErrorCode::kFileWriteFailed:
      return "file_write_failed";
    case ErrorCode::kServiceFailed:
      return "service_failed";
    case ErrorCode::kServiceSilent:
      return "service_silent";
    case ErrorCode::kDuplicateRobot:
      return "duplicate_robot";
    case ErrorCode::kCameraLost:
      return "camera_lost";
    case ErrorCode::kFrameUnreadable:
      return "frame_unreadable";
    case ErrorCode::kImageSizeMismatch:
      return "image_size_mismatch";
    case ErrorCode::kImageDark:
      return "image_dark";
    case ErrorCode::kImageOverexposed:
      return "image_overexposed";
    case ErrorCode::kImageFrozen:
      return "image_frozen";
    case ErrorCode::kLensOccluded:
      return "lens_occluded";
    case ErrorCode::kLensMismatch:
      return "lens_mismatch";
    case ErrorCode::kFloorOnly:
      return "floor_only";
    case ErrorCode::kFloorHidden:
      return "floor_hidden";
    case ErrorCode::kFrameGap:
      return "frame_gap";
    case ErrorCode::kUndecidedRegions:
      return "undecided_regions";
    case ErrorCode::kScanRejected:
      return "scan_rejected";
    case ErrorCode::kNotLocalized:
      return "not_localized";
    case ErrorCode::kFrameMatched:
      return "frame_matched";
    case ErrorCode::kFrameNotMatched:
      return "frame_not_matched";
    case ErrorCode::kPlacesIncomparable:
      return "places_incomparable";
    case ErrorCode::kPoseGap:
      return "pose_gap";
    case ErrorCode::kLocalizationLost:
      return "localization_lost";
    case ErrorCode::kKidnapped:
      return "kidnapped";
    case ErrorCode::kInitialPoseRejected:
      return "initial_pose_rejected";
    case ErrorCode::kInitialPoseUnconfirmed:
      return "initial_pose_unconfirmed";
    case ErrorCode::kWheelSlip:
      return "wheel_slip";
    case ErrorCode::kWheelsUnmatched:
      return "wheels_unmatched";
    case ErrorCode::kWheelAssignment:
      return "wheel_assignment";
    case ErrorCode::kCalibrationError:
      return "calibration_error";
    case ErrorCode::kMeasurementRejected:
      return "measurement_rejected";
    case ErrorCode::kCamerasDisagree:
      return "cameras_disagree";
    case ErrorCode::kMarkersAmbiguous:
      return "markers_ambiguous";
    case ErrorCode::kCommandRejected:
      return "command_rejected";
    case ErrorCode::kGoalUnreachable:
      return "goal_unreachable";
    case ErrorCode::kCollision:
      return "collision";
    case ErrorCode::kContributionRejected:
      return "contribution_rejected";
    case ErrorCode::kCandidatesRejected:
      return "candidates_rejected";
    case ErrorCode::kOutlinesUncertain:
      return "outlines_uncertain";
    case ErrorCode::kMapIncomplete:
      return "map_incomplete";
    case ErrorCode::kMapEmpty:
      return "map_empty";
    case ErrorCode::kTrajectoryIncomplete:
      return "trajectory_incomplete";
    case ErrorCode::kCount:
      break;
  }
  return "?";
}

ErrorCode codeOf(FrameState state) {
  switch (state) {
    case FrameState::kOk:
      return ErrorCode::kNone;
    case FrameState::kMissing:
    case FrameState::kUnreadable:
    case FrameState::kEmpty:
      return ErrorCode::kFrameUnreadable;
    case FrameState::kWrongSize:
      return ErrorCode::kImageSizeMismatch;
    case FrameState::kNonFinite:
      return ErrorCode::kSampleRejected;
    case FrameState::kDark:
      return ErrorCode::kImageDark;
    case FrameState::kOverexposed:
      return ErrorCode::kImageOverexposed;
    case FrameState::kTorn:
      return ErrorCode::kFrameOverwritten;
    case FrameState::kOutOfOrder:
      return ErrorCode::kSampleOutOfOrder;
  }
  return ErrorCode::kSampleRejected;
}

std::string toLogLine(const Message& message) {
  return message.code == ErrorCode::kNone ? message.text
                                          : "[" + std::string(toString(message.code)) + "] " + message.text;
}

}  // namespace omnifleet
