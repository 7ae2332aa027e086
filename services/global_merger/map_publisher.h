#pragma once

#include <memory>
#include <string>

#include "adapters/adapters.h"
#include "bus/service.h"
#include "global_merger/merger.h"
#include "global_merger/outline_tiles.h"

namespace omnifleet::services {

/// Publishes the merged map: octree, grid and outlines (the replica that speaks only) and hash (all
/// replicas).
class MapPublisher {
 public:
  MapPublisher(const bus::ServiceContext& context, const std::string& map_name, const std::string& replica,
               adapters::RunClock clock);

  /// From now on this replica publishes the map with this term; 0: it publishes the hash only. The next
  /// update() publishes.
  void speak(std::uint32_t term);

  /// Publishes if one second of data time has passed and the map has changed, or if `force`. `meanwhile` may
  /// add to the map.
  void update(global_merger::Merger& merger, TimeNs now, bool force, bus::StatusBoard& status,
              const global_merger::Meanwhile& meanwhile = {});

 private:
  void publishMap(const global_merger::Merger& merger, TimeNs now, bus::StatusBoard& status);
  void publishHash(global_merger::Merger& merger, TimeNs now, bus::StatusBoard& status);

  std::string map_name_, replica_;
  bus::Bus& bus_;
  bus::Topics topics_;
  std::uint32_t term_ = 0;
  adapters::RunClock clock_;
  std::unique_ptr<bus::Writer<v1::OctreeMap>> octree_;
  std::unique_ptr<bus::Writer<v1::Grid>> grid_;
  std::unique_ptr<bus::Writer<v1::Outlines>> outlines_;
  std::unique_ptr<bus::Writer<v1::MapHash>> hash_;
  OutlineTiles tiles_;
  std::uint32_t sequence_ = 0;
  TimeNs last_ns_ = INT64_MIN;
  std::array<std::uint8_t, 32> last_hash_{};
};

}  // namespace omnifleet::services
