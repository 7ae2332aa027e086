#pragma once

#include <optional>
#include <string>

#include "common/run_ends.h"
#include "observation/error_code.h"
#include "observation/time_range.h"

namespace omnifleet::services {

/// Notices a stream whose times do not meet those of the frames that it belongs to: a stage would join
/// nothing, and the run would look like one without the stream. Reports once.
class OverlapCheck {
 public:
  /// @param stream for messages, e.g. "laser r1" @param frames e.g. "camera r1/fisheye" @param is_live
  /// samples arrive as they are taken; otherwise only whole streams are compared
  OverlapCheck(std::string stream, std::string frames, bool is_live)
      : stream_(std::move(stream)), frames_(std::move(frames)), is_live_(is_live) {}

  /// One frame. @param newest latest sample of the stream, if any has arrived
  /// @return live: a message when the stream has brought new samples during the last kFrames frames, all of
  /// them far from the frames
  std::optional<Message> addFrame(TimeNs frame_ns, std::optional<TimeRange> samples);
  /// The run has ended. @return a message when the whole streams do not meet
  std::optional<Message> finish();

  static constexpr int kFrames = 10;
  static constexpr TimeNs kApart_ns = 5000000000;  ///< live: larger than the delay of any stage

 private:
  std::optional<Message> report(const TimeRange& frames);

  std::string stream_, frames_;
  bool is_live_;
  bool reported_ = false;
  int apart_ = 0;  ///< consecutive frames far from the stream's newest sample
  std::optional<TimeRange> seen_, samples_;
  TimeNs apart_since_ns_ = 0;   ///< first of these frames
  TimeNs stream_since_ns_ = 0;  ///< newest sample of the stream then
};

}  // namespace omnifleet::services
