#include "camera/messages.h"

#include <fmt/format.h>

#include "common/host_clock.h"
#include "common/rough_duration.h"

namespace omnifleet::services {

Message cameraLost(const std::string& camera, double lost_s, const std::string& reason, double retry_s) {
  const std::string duration = roughDuration(lost_s);
  return {ErrorCode::kCameraLost,
          fmt::format("{}: camera lost{}{}, {}; there are no frames meanwhile. Check its cable and power; "
                      "trying again every {:g} s",
                      camera, duration.empty() ? "" : " ", duration, reason, retry_s)};
}

Message cameraBack(const std::string& camera, double lost_s) {
  return {
      ErrorCode::kCameraLost,
      fmt::format("{}: the camera is back, it was lost for {:.1f} s; frames arrive again", camera, lost_s)};
}

Message cameraClockJump(const std::string& camera, TimeNs jump_ns) {
  return {ErrorCode::kClockJump,
          fmt::format("{}: the system clock of this host was {}; the run keeps its own time, so nothing is "
                      "lost or misplaced. Start the fleet anew if other hosts must agree with the new time",
                      camera, clockSet(jump_ns))};
}

Message cameraSizeChanged(const std::string& camera, const std::string& fault, double retry_s) {
  return {ErrorCode::kImageSizeMismatch,
          fmt::format(
              "{}: {}; its frames are rejected. Use the sensor.yaml of this camera, or connect the camera "
              "that belongs to it; the device is opened again every {:g} s",
              camera, fault, retry_s)};
}

Message noFrameRead(const std::string& camera, std::uint64_t frames) {
  return {
      ErrorCode::kFrameUnreadable,
      fmt::format("{}: none of its {} frames could be read, so it adds nothing to the map; the log of this "
                  "camera names the first one",
                  camera, frames)};
}

}  // namespace omnifleet::services
