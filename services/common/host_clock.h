#pragma once

#include <functional>
#include <optional>
#include <string>

#include "observation/error_code.h"
#include "observation/observation.h"

namespace omnifleet::services {

/// Two clocks of this host at the same moment.
struct ClockReading {
  TimeNs system_ns = 0;  ///< CLOCK_REALTIME; a person, NTP or GPS may set it
  TimeNs monotonic_ns =
      0;  ///< CLOCK_BOOTTIME; never set, counts while the host is suspended. NTP corrects its rate as
          ///< that of the system clock, so that only a set clock changes their difference
};
using ReadClocks = std::function<ClockReading()>;
ClockReading readHostClocks();

/// The time of a live run on one host: the system time at the start of the run, continued by the monotonic
/// clock. It never jumps. Thread-safe if `read` is.
class HostClock {
 public:
  /// Starts at the system time of now.
  explicit HostClock(ReadClocks read = readHostClocks);
  /// @param offset_ns that of another HostClock of this host and run
  HostClock(ReadClocks read, TimeNs offset_ns) : read_(std::move(read)), offset_ns_(offset_ns) {}

  TimeNs now() const { return read_().monotonic_ns + offset_ns_; }
  /// By how much the system clock was set since the start of the run: system time minus run time.
  TimeNs jump() const;
  TimeNs offset() const { return offset_ns_; }

 private:
  ReadClocks read_;
  TimeNs offset_ns_;
};

/// The HostClock that all processes of a run on this host share. Its offset is in OUT/.clock. A process that
/// finds no other running process of the run begins a new run. So a process that is restarted after the
/// system clock was set continues the time of the others.
class SharedClock {
 public:
  /// An `out` that is empty or not writable gives a clock of this process alone.
  explicit SharedClock(const std::string& out, ReadClocks read = readHostClocks);
  ~SharedClock();
  SharedClock(const SharedClock&) = delete;
  SharedClock& operator=(const SharedClock&) = delete;

  const HostClock& clock() const { return clock_; }

 private:
  std::optional<TimeNs> agreedOffset() const;
  void publishOffset() const;

  int file_ = -1;  ///< holds a shared lock while this process runs
  HostClock clock_;
};

/// Notices when the system clock is set.
class ClockWatch {
 public:
  /// @param limit_ns smaller jumps are not reported; their sum is
  ClockWatch(const HostClock& clock, TimeNs limit_ns);
  /// By how much the clock was set since the last report; 0: not.
  TimeNs check();

 private:
  HostClock clock_;
  TimeNs limit_ns_;
  TimeNs reported_ns_;
};

/// "set back by 3600.000 s" or "set forward by 0.250 s".
std::string clockSet(TimeNs jump_ns);

}  // namespace omnifleet::services
