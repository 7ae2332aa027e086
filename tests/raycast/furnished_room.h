#pragma once

#include <Eigen/Core>
#include <vector>

#include "geometry/polygon.h"
#include "tests/raycast/furnished_options.h"
#include "tests/raycast/random.h"
#include "tests/raycast/ray_caster.h"

namespace omnifleet::raycast {

inline constexpr double kClearance_m = 0.28;  ///< planned distance of a robot's centre from everything

/// Axis-parallel inside of one room.
struct Extent {
  Eigen::Vector2d low, high;
  Eigen::Vector2d size() const { return high - low; }
};

struct House {
  std::vector<Extent> rooms;
  Polygon inside;  ///< of the walls
  std::vector<Solid> walls, furniture;
  std::vector<Eigen::Vector2d>
      doors;  ///< middles of closed doors in the walls; furniture keeps clear of them
};

/// Distance from a point to the footprint of a solid, metres. At most 0 inside.
double distanceTo(const Solid& solid, const Eigen::Vector2d& at);

/// Distance along the unit vector `along` to the footprint of a solid; infinity if the ray misses it.
double rangeTo(const Solid& solid, const Eigen::Vector2d& from, const Eigen::Vector2d& along);

/// The solid turned by 180° about the origin.
Solid turnedAround(Solid solid);

/// Walls around one room, or around two rooms joined by a door; furniture that leaves each room reachable.
/// In a symmetric house walls and furniture come in pairs: number 2k + 1 is number 2k turned around.
House furnishedHouse(const FurnishedOptions& options, Random& random);

/// The same walls with other furniture.
House refurnished(House house, const FurnishedOptions& options, Random& random);

/// The house with floor, lamps and final colours.
Room litRoom(const House& house, const FurnishedOptions& options, Random& random);

/// The same floor, lamps and walls with the furniture of `house` and other grain of the floor.
Room refurnished(Room room, const House& house, const FurnishedOptions& options, Random& random);

}  // namespace omnifleet::raycast
