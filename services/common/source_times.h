#pragma once

#include <deque>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "bus/service.h"
#include "common/host_clock.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Converts the times of one stream from outside the run (a robot base, a laser driver) to the time of the
/// run, as its samples arrive. Such a publisher stamps with the system clock. After that clock was set, its
/// times jump, those of the run do not. Three cases:
/// - the system clock of this host was set (HostClock::jump): a sample that is as old as samples usually are
/// only if
///   that jump is subtracted comes from a publisher on this host. The correction is exact.
/// - the times go back although the clock of this host was not set: the clock of the publisher's host was, or
/// the
///   publisher counts anew. After kBackward samples the stream continues where it was, as accurate as the
///   delay of the samples is constant.
/// - otherwise times are not changed.
class SourceTimes {
 public:
  /// @param stream for messages, e.g. "wheels/odometry r1" @param limit_ns smaller jumps of the clock are
  /// ignored
  SourceTimes(std::string stream, HostClock clock, ReadClocks read, TimeNs limit_ns);

  /// @return time in the run of a sample that has just arrived
  TimeNs toRun(TimeNs stamp_ns);
  /// What was found about the clock of the publisher since the last call.
  std::optional<Message> takeMessage() { return std::exchange(message_, std::nullopt); }

  static constexpr int kBackward = 3;  ///< consecutive samples that show that a clock was set back

 private:
  TimeNs age(TimeNs stamp_ns, TimeNs correction_ns) const;
  void followHost(TimeNs stamp_ns);
  void followStream(TimeNs stamp_ns);
  void correct(TimeNs correction_ns);

  std::string stream_;
  HostClock clock_;
  ReadClocks read_;
  TimeNs limit_ns_;
  TimeNs now_ns_ = 0;                    ///< of the run, at the arrival of the sample
  TimeNs jump_ns_ = 0;                   ///< of the host's system clock
  TimeNs correction_ns_ = 0;             ///< added to the stamps
  std::optional<TimeNs> own_offset_ns_;  ///< correction by the stream's own times
  int better_ = 0;                       ///< consecutive samples that fit another correction
  int backward_ = 0;
  TimeNs backward_ns_ = 0;         ///< stamp of the latest of them
  std::optional<TimeNs> last_ns_;  ///< latest time in the run, and the run time of its arrival
  TimeNs last_arrived_ns_ = 0;
  std::optional<Message> message_;
};

/// The streams of one stage whose times come from system clocks. Active in live runs with real sensors alone:
/// in all other runs the times are those of a recording or a simulation.
class LiveTimes {
 public:
  LiveTimes(const bus::ServiceContext& context, const fleet::Fleet& fleet, ReadClocks read = readHostClocks);

  /// Converts the times of all samples of an Inlet or FrameInlet.
  template <class Inlet>
  void follow(Inlet& inlet, const std::string& stream) {
    if (SourceTimes* times = add(stream)) inlet.follow(times);
  }
  void report(bus::StatusBoard& status);

 private:
  SourceTimes* add(const std::string& stream);

  ReadClocks read_;
  TimeNs limit_ns_;
  std::unique_ptr<SharedClock> clock_;
  std::deque<SourceTimes> streams_;  ///< inlets hold pointers to them
};

}  // namespace omnifleet::services
