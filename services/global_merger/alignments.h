#pragma once

#include <map>
#include <memory>
#include <optional>
#include <string>

#include "adapters/adapters.h"
#include "bus/service.h"
#include "common/run_ends.h"
#include "fleet/fleet.h"

namespace omnifleet::services {

/// Topic alignment: the latest sample of each robot. An external localizer may publish none.
class Alignments {
 public:
  /// @param reads false: receives nothing
  Alignments(const bus::ServiceContext& context, const fleet::Fleet& fleet, bool reads, RunEnds& ends);

  /// Returns whether there was any input.
  bool pull(bus::StatusBoard& status);
  /// False while the last sample of a stream is still to come whose end has been announced ("alignment
  /// <robot>").
  bool complete() const;
  const std::map<std::string, Alignment>& latest() const { return latest_; }

 private:
  struct Stream {
    TimeNs arrived_ns = RunEnds::kNothing, last_ns = RunEnds::kNothing;
  };

  std::unique_ptr<bus::Reader<v1::Alignment>> reader_;
  std::map<std::string, Stream> streams_;  ///< by robot
  std::map<std::string, Alignment> latest_;
  v1::Alignment sample_;
};

}  // namespace omnifleet::services
