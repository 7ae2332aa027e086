#pragma once

#include <optional>
#include <string>

#include "observation/error_code.h"
#include "observation/observation.h"

namespace omnifleet::local_mapper {

/// Notices wheel rows whose times meet no frame: another clock or another unit of time. Without this check
/// the run looks like one of a robot without wheels.
class WheelCheck {
 public:
  /// Acquisition times of the rows received so far.
  struct Rows {
    TimeNs first_ns = 0, last_ns = 0;
    bool any = false;
  };

  explicit WheelCheck(std::string robot) : robot_(std::move(robot)) {}

  /// One frame. @param has_motion the wheels gave its motion
  /// @return a message, once, after kFrames frames without any motion
  std::optional<Message> add(TimeNs frame_ns, bool has_motion, const Rows& rows);

  static constexpr int kFrames = 10;  ///< two seconds at 5 Hz: longer than any wheel row is late

 private:
  std::string robot_;
  TimeNs first_ns_ = 0;
  int frames_ = 0;
  bool settled_ = false;  ///< a motion was given, or the message was returned
};

}  // namespace omnifleet::local_mapper
