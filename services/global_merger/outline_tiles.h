#pragma once

#include <cstdint>
#include <map>
#include <utility>
#include <vector>

#include "adapters/adapters.h"
#include "global_merger/merger.h"
#include "idl/map.h"

namespace omnifleet::services {

/// The objects of the map in tiles, for map/outlines: after an update only the tiles whose content differs
/// are published, so the traffic follows what the robots see, not the size of the map.
class OutlineTiles {
 public:
  /// Edge of a tile, metres. A furnished room of 30 m² has about 2.3 kB of outlines, so a tile has about 1
  /// kB.
  static constexpr double kSide_m = 4.0;

  /// The tiles whose content differs from that of the call before: without header, name and term. A tile in
  /// which nothing is left is empty.
  std::vector<v1::Outlines> update(const std::vector<dataset::MapObject>& objects,
                                   const std::vector<global_merger::RejectedCandidate>& rejected);
  /// The next update returns all tiles that are not empty.
  void clear() { published_.clear(); }

 private:
  using Index = std::pair<std::int32_t, std::int32_t>;
  std::map<Index, v1::Outlines> published_;
};

}  // namespace omnifleet::services
