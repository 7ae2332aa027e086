#pragma once

#include "tests/raycast/room_path.h"

namespace omnifleet::raycast {

/// A tour of one robot: around the room and back to its first place, then through the room between random
/// goals and back once more before the images end. It turns by less than 100° at a goal where the room allows
/// it. Throws std::runtime_error if the images (options.frames, steps) do not reach around any loop of 3 m.
DrivePlan tourOf(const FurnishedOptions& options, const FreeSpace& space, Random& random);

}  // namespace omnifleet::raycast
