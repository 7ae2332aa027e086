#pragma once

#include <string>

#include "observation/error_code.h"

namespace omnifleet::services {

// Messages that any service reports about its inputs and outputs. `stream` is a topic with its robot or
// camera.

inline Message sampleRejected(const std::string& stream) {
  return {ErrorCode::kSampleRejected,
          stream + ": sample rejected, a value is not finite or out of range; check its publisher"};
}
inline Message sampleOutOfOrder(const std::string& stream) {
  return {
      ErrorCode::kSampleOutOfOrder,
      stream + ": sample rejected, it is not later than the one before; check the clock of its publisher"};
}
inline Message lastSamplesMissing(const std::string& stream) {
  return {
      ErrorCode::kStreamSilent,
      stream +
          ": its last samples did not arrive within 2 s of its announced end; this service goes on without "
          "them"};
}
inline Message frameOverwritten(const std::string& stream) {
  return {ErrorCode::kFrameOverwritten,
          stream + ": the camera overwrote a frame that was still in use; the frame is skipped"};
}
inline Message writeFailed(const std::string& stream, const std::string& reason) {
  return {ErrorCode::kWriteFailed, stream + ": sample not published: " + reason};
}
inline Message fileWriteFailed(const std::string& reason) {
  return {ErrorCode::kFileWriteFailed, reason};
}

}  // namespace omnifleet::services
