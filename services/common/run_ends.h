#pragma once

#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <string>

#include "bus/service.h"

namespace omnifleet::services {

/// The run/end topic as one stage sees it: hears when its input streams end, says when its own have ended.
/// Streams are named "<topic> <robot, camera or source>", e.g. "local_map r1".
class RunEnds {
 public:
  explicit RunEnds(const bus::ServiceContext& context);

  /// `ended` is called once, when the stream's end is heard, with the time of its last sample (kNothing when
  /// there was none) and their number.
  using Ended = std::function<void(TimeNs last, std::uint64_t samples)>;
  void listen(const std::string& stream, Ended ended);
  /// Takes what has arrived; true when anything was heard that someone listens for.
  bool poll();
  /// Our stream has ended. An empty reason is the regular end. Live, who is told to stop says nothing: he may
  /// be started again, and whoever stops the whole fleet tells the others himself.
  void announce(const std::string& stream, TimeNs last, std::uint64_t samples,
                const std::string& reason = {});

  static constexpr TimeNs kNothing = INT64_MIN;

 private:
  bus::Bus& bus_;
  bool is_live_;
  std::unique_ptr<bus::Reader<v1::RunEnd>> reader_;
  std::unique_ptr<bus::Writer<v1::RunEnd>> writer_;
  std::map<std::string, Ended> listeners_;
  v1::RunEnd sample_;
};

}  // namespace omnifleet::services
