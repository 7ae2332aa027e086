#pragma once

#include <string>
#include <vector>

namespace omnifleet::ceiling_view {

/// Draws the result of a run as each ceiling camera of the recording saw it:
/// OUT/ceiling/<camera>_tracking.png (poses of the robots) and OUT/ceiling/<camera>_map.png (the map), both
/// over the camera's last readable image.
/// @return the files written. Throws options::Error if the recording or the run cannot be read,
/// std::runtime_error if a picture cannot be written.
std::vector<std::string> run(const std::string& out, const std::string& dataset);

}  // namespace omnifleet::ceiling_view
