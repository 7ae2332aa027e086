#pragma once

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>

#include "adapters/adapters.h"
#include "bus/service.h"
#include "common/run_ends.h"
#include "fleet/fleet.h"
#include "global_merger/place_files.h"

namespace omnifleet::services {

/// Topic place: the nodes of the topological maps. An external localizer may publish none.
class Places {
 public:
  /// @param reads false: receives nothing
  Places(const bus::ServiceContext& context, const fleet::Fleet& fleet, bool reads, RunEnds& ends);

  /// Returns whether there was any input.
  bool pull(bus::StatusBoard& status);
  /// False while samples are still to come of a stream whose end has been announced ("place <robot>").
  bool complete() const;
  const global_merger::PlaceFiles& files() const { return files_; }

 private:
  struct Stream {
    std::uint64_t arrived = 0, announced = 0;
  };

  std::unique_ptr<bus::Reader<v1::Place>> reader_;
  std::map<std::string, Stream> streams_;  ///< by robot
  global_merger::PlaceFiles files_;
  v1::Place sample_;
  Place place_;
};

}  // namespace omnifleet::services
