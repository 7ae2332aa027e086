#pragma once

#include <cstdint>
#include <string>

#include "observation/error_code.h"

// What the service of a camera reports. `camera` is its id.
namespace omnifleet::services {

/// The device delivers no frames. @param lost_s since when @param retry_s longest pause between two attempts
Message cameraLost(const std::string& camera, double lost_s, const std::string& reason, double retry_s);
/// Frames arrive again.
Message cameraBack(const std::string& camera, double lost_s);
/// The system clock of the camera's host was set.
Message cameraClockJump(const std::string& camera, TimeNs jump_ns);
/// The device keeps delivering frames of another size than sensor.yaml.
Message cameraSizeChanged(const std::string& camera, const std::string& fault, double retry_s);
/// A recording, folder or video has ended, and none of its frames was valid. @param frames > 0
Message noFrameRead(const std::string& camera, std::uint64_t frames);

}  // namespace omnifleet::services
