#pragma once

#include <optional>
#include <vector>

#include "dataset/map_files.h"
#include "geometry/pose2.h"

namespace omnifleet::evaluation {

/// What a map's cells say that is not so: cells called free where nobody can be. Areas in m², a cell counting
/// whole where its middle lies.
struct FreeSpaceMetrics {
  double free_m2 = 0.0;               ///< all that is called free
  double in_obstacles_m2 = 0.0;       ///< of it, inside of true obstacles
  std::optional<double> outside_m2;   ///< of it, outside of the room; nothing where the truth has none
  std::optional<double> walls_found;  ///< share of the room's outline with an occupied cell within kAtWall_m
  static constexpr double kAtWall_m = 0.15;
};

/// @param grid in the frame of the run @param truth_from_map moves it onto the truth
/// @param scene objects of kind "obstacle" are compared @param room its walls' inner side; empty: unknown
FreeSpaceMetrics compareFreeSpace(const dataset::OccupancyGrid& grid, const Pose2& truth_from_map,
                                  const std::vector<dataset::MapObject>& scene, const Polygon& room);

}  // namespace omnifleet::evaluation
