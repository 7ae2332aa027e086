#include "local_mapper/wheel_check.h"

#include "local_mapper/messages.h"

namespace omnifleet::local_mapper {

std::optional<Message> WheelCheck::add(TimeNs frame_ns, bool has_motion, const Rows& rows) {
  if (settled_) return std::nullopt;
  if (frames_ == 0) first_ns_ = frame_ns;
  ++frames_;
  settled_ = has_motion || frames_ >= kFrames;
  if (!settled_ || has_motion) return std::nullopt;
  return rows.any ? wheelsUnmatched(robot_, {first_ns_, frame_ns}, {rows.first_ns, rows.last_ns})
                  : wheelsSilent(robot_, frames_);
}

}  // namespace omnifleet::local_mapper
