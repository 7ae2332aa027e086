#pragma once

#include <string>

#include "tests/raycast/furnished_options.h"
#include "tests/raycast/furnished_room.h"
#include "tests/raycast/room_path.h"

namespace omnifleet::raycast {

/// What a recording shows, before it is rendered.
struct FurnishedScene {
  House house;
  Drive drive;
  Room room;
  lens::CameraModel camera;                 ///< of every robot
  std::vector<std::vector<Solid>> persons;  ///< per frame; empty without options.occluded_share
};

/// Throws std::runtime_error if the options contradict each other or if no free path exists.
FurnishedScene furnishedScene(const FurnishedOptions& options, Random& random);

/// Robots drive smooth paths between random goals in a furnished room. Writes a data set with poses,
/// footprints of the furniture (scene.geojson) and the inside of the walls (room.geojson). Persons are not in
/// the truth. Throws std::runtime_error like furnishedScene() or if a file cannot be written.
void recordFurnished(const std::string& folder, const FurnishedOptions& options);

}  // namespace omnifleet::raycast
