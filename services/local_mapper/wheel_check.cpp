#include "local_mapper/wheel_check.h"

#include "local_mapper/messages.h"

namespace omnifleet::local_mapper {

std::optional<Message> WheelCheck::add(TimeNs frame_ns, bool has_motion,
                                       const std::optional<TimeRange>& rows) {
  if (settled_) return std::nullopt;
  if (frames_ == 0) seen_.first_ns = frame_ns;
  seen_.last_ns = frame_ns;
  ++frames_;
  settled_ = has_motion;
  if (has_motion || frames_ < kFrames || frame_ns - seen_.first_ns < patience_ns_) return std::nullopt;
  return report(rows);
}

std::optional<Message> WheelCheck::finish(const std::optional<TimeRange>& rows) {
  constexpr int kFew = 3;  // the first frame never has a motion, the second one may precede the wheels
  if (settled_ || frames_ < kFew) return std::nullopt;
  return report(rows);
}

std::optional<Message> WheelCheck::report(const std::optional<TimeRange>& rows) {
  settled_ = true;
  return rows ? wheelsUnmatched(robot_, seen_, *rows) : wheelsSilent(robot_, frames_);
}

}  // namespace omnifleet::local_mapper
