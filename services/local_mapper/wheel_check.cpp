#include "local_mapper/wheel_check.h"

#include <utility>

#include "local_mapper/messages.h"

namespace omnifleet::local_mapper {

bool WheelCheck::isOver(Wait& wait, TimeNs frame_ns) const {
  if (wait.frames == 0) wait.first_ns = frame_ns;
  ++wait.frames;
  return wait.frames >= kFrames && frame_ns - wait.first_ns >= patience_ns_;
}

std::optional<Message> WheelCheck::add(TimeNs frame_ns, bool has_motion,
                                       const std::optional<TimeRange>& rows) {
  if (settled_) return std::nullopt;
  if (without_rows_.frames + with_rows_.frames == 0) seen_.first_ns = frame_ns;
  seen_.last_ns = frame_ns;
  settled_ = has_motion;
  const bool is_over = isOver(rows ? with_rows_ : without_rows_, frame_ns);
  if (settled_ || !is_over) return std::nullopt;
  if (rows) {
    settled_ = true;
    return wheelsUnmatched(robot_, seen_, *rows);
  }
  if (std::exchange(is_silence_reported_, true)) return std::nullopt;
  return wheelsSilent(robot_, without_rows_.frames);
}

std::optional<Message> WheelCheck::finish(const std::optional<TimeRange>& rows) {
  constexpr int kFew = 3;  // the first frame never has a motion, the second one may precede the wheels
  const int frames = without_rows_.frames + with_rows_.frames;
  if (std::exchange(settled_, true) || frames < kFew) return std::nullopt;
  if (rows) return wheelsUnmatched(robot_, seen_, *rows);
  if (is_silence_reported_) return std::nullopt;
  return wheelsSilent(robot_, frames);
}

}  // namespace omnifleet::local_mapper
