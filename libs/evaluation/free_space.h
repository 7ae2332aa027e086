#pragma once

#include <optional>
#include <vector>

#include "dataset/map_files.h"
#include "geometry/pose2.h"

namespace omnifleet::evaluation {

/// Errors of an occupancy grid: free cells where no robot can be. Areas in m²; a cell counts as a whole by
/// its centre.
struct FreeSpaceMetrics {
  double free_m2 = 0.0;              ///< area of all free cells
  double in_obstacles_m2 = 0.0;      ///< free area inside true obstacles
  std::optional<double> outside_m2;  ///< free area outside the room; empty without a room in the truth
  std::optional<double>
      walls_found;  ///< share of the outline of the room with an occupied cell within kAtWall_m
  static constexpr double kAtWall_m = 0.15;
};

/// @param grid in the frame of the run
/// @param truth_from_map aligns the run with the truth
/// @param scene objects of kind "obstacle" are compared
/// @param room inner side of the walls; empty: unknown
FreeSpaceMetrics compareFreeSpace(const dataset::OccupancyGrid& grid, const Pose2& truth_from_map,
                                  const std::vector<dataset::MapObject>& scene, const Polygon& room);

}  // namespace omnifleet::evaluation
