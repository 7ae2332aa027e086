#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "adapters/adapters.h"
#include "bus/service.h"

namespace omnifleet::services {

/// The run/end topic for one stage: receives the ends of its input streams and announces those of its output
/// streams. Stream names are "<topic> <robot, camera or source>", e.g. "local_map r1".
class RunEnds {
 public:
  /// @param clock of the announced times
  explicit RunEnds(const bus::ServiceContext& context,
                   adapters::RunClock clock = adapters::RunClock::kSystem);

  /// Called once, when the end of the stream is received. @param last time of the last sample, kNothing if
  /// there was none @param samples number of samples
  using Ended = std::function<void(TimeNs last, std::uint64_t samples)>;
  void listen(const std::string& stream, Ended ended);
  /// Processes the received ends. @return whether any of them belongs to a stream with a listener
  bool poll();
  /// Announces the end of an output stream. An empty reason is the regular end. In live mode a stopped
  /// service announces nothing: it may be restarted, and a stop of the whole fleet stops its readers as well.
  void announce(const std::string& stream, TimeNs last, std::uint64_t samples,
                const std::string& reason = {});

  static constexpr TimeNs kNothing = INT64_MIN;

 private:
  bus::Bus& bus_;
  bool is_live_;
  adapters::RunClock clock_;
  std::unique_ptr<bus::Reader<v1::RunEnd>> reader_;
  std::unique_ptr<bus::Writer<v1::RunEnd>> writer_;
  std::map<std::string, Ended> listeners_;
  v1::RunEnd sample_;
};

}  // namespace omnifleet::services
