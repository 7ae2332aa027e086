#pragma once

#include <memory>
#include <string>

#include "adapters/adapters.h"
#include "bus/service.h"
#include "global_merger/merger.h"

namespace omnifleet::services {

/// Publishes the merged map: octree, grid and outlines (publishing replica only) and hash (all replicas).
class MapPublisher {
 public:
  MapPublisher(const bus::ServiceContext& context, const std::string& map_name, const std::string& replica,
               bool publishes);

  /// Publishes if one second of data time has passed and the map has changed, or if `force`. `meanwhile` may
  /// add to the map.
  void update(global_merger::Merger& merger, TimeNs now, bool force, bus::StatusBoard& status,
              const global_merger::Meanwhile& meanwhile = {});

 private:
  void publishMap(const global_merger::Merger& merger, TimeNs now, bus::StatusBoard& status);
  void publishHash(global_merger::Merger& merger, TimeNs now, bus::StatusBoard& status);

  std::string map_name_, replica_;
  bool publishes_;
  adapters::RunClock clock_;
  std::unique_ptr<bus::Writer<v1::OctreeMap>> octree_;
  std::unique_ptr<bus::Writer<v1::Grid>> grid_;
  std::unique_ptr<bus::Writer<v1::Outlines>> outlines_;
  std::unique_ptr<bus::Writer<v1::MapHash>> hash_;
  std::uint32_t sequence_ = 0;
  TimeNs last_ns_ = INT64_MIN;
  std::array<std::uint8_t, 32> last_hash_{};
};

}  // namespace omnifleet::services
