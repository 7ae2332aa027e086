#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "dataset/markers.h"
#include "observation/observation.h"
#include "tests/raycast/arena_options.h"
#include "tests/raycast/free_space.h"

namespace omnifleet::raycast {

inline constexpr int kMapping = 2, kRobots = 4;  ///< r1 and r2 map, r3 and r4 are parked
inline constexpr double kBodyHeight_m = 0.10;

/// Extent of a body in base_link, which lies behind the middle of the body.
inline const Extent kBody{{-0.072, -0.06}, {0.088, 0.06}};
inline const double kBodyReach_m = kBody.high.norm();  ///< from base_link to the farthest corner

/// An enclosed arena, divided by walls of blocks, with parked robots. Lengths are metres, in map.
struct ArenaLayout {
  House house;                ///< one room; its furniture are the blocks, each with its own colour
  std::vector<Pose2> parked;  ///< r3, r4
  std::vector<FloorMarking> cards;
  dataset::MarkerSet markers;
};

std::string arenaRobot(int index);  ///< "r1", …
RobotBody arenaBody();

/// Corners of a rectangle given in base_link, in map, counter-clockwise.
Polygon rectangleAt(const Pose2& map_from_base, const Eigen::Vector2d& low, const Eigen::Vector2d& high);

/// The body of a robot as a box without markers.
Solid bodyAt(const Pose2& map_from_base);

/// The house with the parked robots as furniture.
House withParked(const ArenaLayout& layout);

/// Distance of two convex polygons; at most 0 if they overlap.
double gapBetween(const Polygon& a, const Polygon& b);

/// Throws std::runtime_error if the layout is unknown or no arrangement leaves the arena accessible.
ArenaLayout arenaLayout(const ArenaOptions& options, Random& random);

}  // namespace omnifleet::raycast
