#include "common/overlap_check.h"

#include <fmt/format.h>

#include <algorithm>
#include <cstdlib>

namespace omnifleet::services {

std::optional<Message> OverlapCheck::report(const TimeRange& frames) {
  reported_ = true;
  return Message{
      ErrorCode::kClockOffset,
      fmt::format("{}: its samples meet no frame and are not used. {}: {}, {}: {}. Likely cause: {}. Use one "
                  "clock for both, times in ns",
                  stream_, frames_, toString(frames), stream_, toString(*samples_),
                  likelyCause("times of " + stream_, *samples_, frames))};
}

std::optional<Message> OverlapCheck::addFrame(TimeNs frame_ns, std::optional<TimeRange> samples) {
  samples_ = samples;
  if (!seen_) seen_ = TimeRange{frame_ns, frame_ns};
  seen_->last_ns = std::max(seen_->last_ns, frame_ns);
  if (!is_live_ || reported_) return std::nullopt;
  const bool is_apart = samples && std::abs(samples->last_ns - frame_ns) > kApart_ns;
  if (!is_apart) {
    apart_ = 0;
    return std::nullopt;
  }
  if (apart_ == 0) {
    apart_since_ns_ = frame_ns;
    stream_since_ns_ = samples->last_ns;
  }
  // Frames of the past that arrive together, or a silent stream, do not mean another clock.
  const bool advances = 2 * (samples->last_ns - stream_since_ns_) > frame_ns - apart_since_ns_;
  if (++apart_ < kFrames || !advances) return std::nullopt;
  samples_->first_ns = stream_since_ns_;  // the two ranges are those of the same time
  return report({apart_since_ns_, frame_ns});
}

std::optional<Message> OverlapCheck::finish() {
  if (reported_ || !seen_ || !samples_ || seen_->meets(*samples_, 0)) return std::nullopt;
  return report(*seen_);
}

}  // namespace omnifleet::services
