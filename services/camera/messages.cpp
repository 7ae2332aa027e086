#include "camera/messages.h"

#include <fmt/format.h>

#include <array>
#include <cmath>

#include "common/host_clock.h"

namespace omnifleet::services {
namespace {

/// "for more than 10 s". In steps, so that a log that writes every change stays short.
std::string roughly(double seconds) {
  constexpr std::array<double, 9> kSteps_s{1, 2, 5, 10, 20, 30, 60, 120, 300};
  if (seconds < kSteps_s.front()) return {};
  double step_s = kSteps_s.front();
  for (const double s : kSteps_s)
    if (s <= seconds) step_s = s;
  constexpr double kStep_s = 600.0;
  if (seconds >= kStep_s) step_s = kStep_s * std::floor(seconds / kStep_s);
  if (step_s < 60.0) return fmt::format(" for more than {:.0f} s", step_s);
  return fmt::format(" for more than {:.0f} min", step_s / 60.0);
}

}  // namespace

Message cameraLost(const std::string& camera, double lost_s, const std::string& reason, double retry_s) {
  return {ErrorCode::kCameraLost,
          fmt::format("{}: camera lost{}, {}; there are no frames meanwhile. Check its cable and power; "
                      "trying again every {:g} s",
                      camera, roughly(lost_s), reason, retry_s)};
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

}  // namespace omnifleet::services
