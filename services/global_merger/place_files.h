#pragma once

#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::global_merger {

/// The topological maps of all robots, from the latest sample of each place.
class PlaceFiles {
 public:
  void add(const Place& place) { places_[place.robot][place.index] = place; }

  /// Writes places/<robot>.g2o with its signatures (appearance/map_files.h) and places/<robot>.png below
  /// `out`, for a robot in a frame of its own below out/maps/<robot>. A place whose signature has another
  /// format than the robot's first one is left out. Returns one line per file that failed.
  std::vector<std::string> save(const std::string& out) const;

  /// Removes what save() has written below a folder for a robot, and the folder if it is empty then.
  static void remove(const std::string& robot, const std::string& folder);

 private:
  using OfRobot = std::map<std::uint32_t, Place>;
  std::map<std::string, OfRobot> places_;
};

}  // namespace omnifleet::global_merger
