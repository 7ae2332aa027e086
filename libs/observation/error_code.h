#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "observation/observation.h"

namespace omnifleet {

/// Stable identifiers of the problems that a service reports on topic service/status. Programs may react to
/// them. idl/README.md and docs/guide/troubleshooting.md describe each. A name never changes its meaning.
enum class ErrorCode : std::uint8_t {
  kNone,
  // inputs of any service
  kSampleRejected,
  kSampleOutOfOrder,
  kFrameOverwritten,
  kStreamSilent,
  kRowsRejected,
  kClockJump,
  kClockOffset,
  // outputs of any service
  kWriteFailed,
  kFileWriteFailed,
  kServiceFailed,
  kServiceSilent,
  kDuplicateRobot,
  // camera, local mapper
  kCameraLost,
  kFrameUnreadable,
  kImageSizeMismatch,
  kImageDark,
  kImageOverexposed,
  kImageFrozen,
  kLensOccluded,
  kLensMismatch,
  kFloorOnly,
  kFloorHidden,
  kFrameGap,
  kUndecidedRegions,
  kScanRejected,
  // localizer
  kNotLocalized,
  kFrameMatched,
  kFrameNotMatched,
  kPlacesIncomparable,
  kLocalizationLost,
  kPoseGap,
  kKidnapped,
  kInitialPoseRejected,
  kInitialPoseUnconfirmed,
  kWheelSlip,
  kWheelsUnmatched,
  kWheelAssignment,
  kCalibrationError,
  kMeasurementRejected,
  kCamerasDisagree,
  kMarkersAmbiguous,
  // formation, world
  kCommandRejected,
  kGoalUnreachable,
  kCollision,
  // merger
  kContributionRejected,
  kCandidatesRejected,
  kOutlinesUncertain,
  kMapIncomplete,
  kMapEmpty,
  kTrajectoryIncomplete,
  kCount
};

/// Its name on the wire and in logs, e.g. "lens_occluded"; empty for kNone.
const char* toString(ErrorCode code);

/// The code of a frame or scan that is not kOk; kNone for kOk.
ErrorCode codeOf(FrameState state);

/// A problem as a service reports it. The text says what happened, where, the consequence and what to do.
struct Message {
  ErrorCode code = ErrorCode::kNone;
  std::string text;

  bool operator==(const Message& other) const { return code == other.code && text == other.text; }
  bool operator!=(const Message& other) const { return !(*this == other); }
};

/// "[code] text", as a line of a log.
std::string toLogLine(const Message& message);

}  // namespace omnifleet
