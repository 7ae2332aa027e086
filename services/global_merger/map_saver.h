#pragma once

#include <map>
#include <string>
#include <vector>

#include "bus/status_board.h"
#include "fleet/fleet.h"
#include "global_merger/merger.h"
#include "global_merger/own_maps.h"
#include "global_merger/place_files.h"

namespace omnifleet::services {

/// Saves the results of a run: the common map, the maps of robots that are in frames of their own
/// (maps/<robot>/), how each robot relates to the common map (merge.json), and the topological maps
/// (places/).
class MapSaver {
 public:
  /// @param out run directory; empty: nothing is saved
  MapSaver(std::string out, const fleet::Fleet& fleet);

  /// With the outlines as last fitted. Each file is written whole or not at all; reports those that failed.
  void save(const global_merger::Merger& common, const global_merger::OwnMaps& own,
            const std::map<std::string, Alignment>& alignments, const global_merger::PlaceFiles& places,
            bus::StatusBoard& status);
  /// Whether a file of the last save failed.
  bool failed() const { return failed_; }

 private:
  std::string out_;
  std::vector<std::string> robots_;
  bool failed_ = false;
};

}  // namespace omnifleet::services
