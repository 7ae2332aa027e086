#pragma once

#include <string>

#include "observation/observation.h"

namespace omnifleet {

/// Times of the first and the last sample of a stream.
struct TimeRange {
  TimeNs first_ns = 0, last_ns = 0;

  bool meets(const TimeRange& other, TimeNs slack_ns) const {
    return first_ns <= other.last_ns + slack_ns && other.first_ns <= last_ns + slack_ns;
  }
};

/// "1000.000 to 1001.800 s".
std::string toString(const TimeRange& range);

/// Why the times of two streams of one run do not meet, as a clause for a message: another unit (a factor of
/// 1000; of two times since the start of a machine either may be the wrong one), a time zone (whole or half
/// hours), a clock that counts since the machine was started, or another clock.
/// @param name of the stream whose times are doubted
std::string likelyCause(const std::string& name, const TimeRange& stream, const TimeRange& frames);

}  // namespace omnifleet
