#pragma once

#include <optional>
#include <string>

#include "observation/error_code.h"
#include "observation/time_range.h"

namespace omnifleet::local_mapper {

/// Notices wheel rows whose times meet no frame (another clock or another unit of time), and wheels that
/// no process publishes. Without this check the run looks like one of a robot without wheels. `rows`:
/// acquisition times of the rows received so far; empty: none.
class WheelCheck {
 public:
  /// @param patience_ns how long the wheels may be missing; live, the robot base may start later than the
  /// camera
  explicit WheelCheck(std::string robot, TimeNs patience_ns = 0)
      : robot_(std::move(robot)), patience_ns_(patience_ns) {}

  /// One frame. @param has_motion the wheels gave its motion
  /// @return a message after kFrames frames and the patience: once if no row has arrived since the first
  /// frame, and once if rows arrive but none gives a motion (also after the first message)
  std::optional<Message> add(TimeNs frame_ns, bool has_motion, const std::optional<TimeRange>& rows);
  /// The frames have ended. @return the message of a run that was too short for add()
  std::optional<Message> finish(const std::optional<TimeRange>& rows);

  static constexpr int kFrames = 10;  ///< two seconds at 5 Hz: longer than any wheel row is late

 private:
  /// Frames in a row, since the first one or since rows arrive.
  struct Wait {
    TimeNs first_ns = 0;
    int frames = 0;
  };
  bool isOver(Wait& wait, TimeNs frame_ns) const;

  std::string robot_;
  TimeNs patience_ns_;
  TimeRange seen_;  ///< frames
  Wait without_rows_, with_rows_;
  bool is_silence_reported_ = false;
  bool settled_ = false;  ///< a motion was given, or rows without motion were reported
};

}  // namespace omnifleet::local_mapper
