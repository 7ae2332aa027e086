#pragma once

#include <opencv2/core.hpp>

#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "geometry/polygon.h"
#include "geometry/pose2.h"

namespace omnifleet::exploration {

/// The room as it is: obstacles, walls and parked robots.
struct TrueRoom {
  Polygon room_m;                 ///< map, inner side of the walls
  std::vector<Polygon> solids_m;  ///< map, obstacles and parked robots
  std::vector<Pose2> starts;      ///< initial poses of the robots that explore
};

/// Floor of a room on a grid of 1 cm. Nonzero: belongs to it.
struct ReachableFloor {
  static constexpr double kCell_m = 0.01;
  Eigen::Vector2d origin_m;  ///< map, corner of cell (0, 0)
  cv::Mat1b covered;         ///< free floor within `reach_m + margin_m` of a place that a robot can reach
  cv::Mat1b visible;         ///< free floor that can be seen from such a place

  /// A robot can be where the circle about base_link that holds its body keeps `margin_m` from all solids,
  /// connected to an initial pose. `sight_m`: farthest floor that counts as visible.
  static ReachableFloor of(const TrueRoom& room, double reach_m, double margin_m, double sight_m);
};

/// Share of the floor whose cell of the map is known (free, or occupied by a face nearby).
struct Coverage {
  double covered_m2 = 0.0, covered_share = 0.0;
  double visible_m2 = 0.0, visible_share = 0.0;
  double wrong_m2 = 0.0;  ///< cells that are occupied more than 3 cm from a face, or free inside of solids
};
Coverage compare(const dataset::OccupancyGrid& map, const ReachableFloor& floor, const TrueRoom& room);

/// The map with the floor that is missing: red covered, orange visible.
void drawMissing(const dataset::OccupancyGrid& map, const ReachableFloor& floor, const std::string& path);

}  // namespace omnifleet::exploration
