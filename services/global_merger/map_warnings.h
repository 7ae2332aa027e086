#pragma once

#include <Eigen/Core>
#include <vector>

#include "dataset/map_files.h"

// Places where the map may be incomplete.

namespace omnifleet::global_merger {

/// Thinner than 10 cm and more than twice as long: a board, or the dark side of an object whose other sides
/// look like the floor and are not in the map.
bool isSliver(const Polygon& outline_m);

/// Centres (map, metres) of occupied cells without an outline: connected cells, farther than 5 cm from every
/// object, at most 80 cm long and not a straight line, which would be a piece of a wall. They belong to
/// objects that were hardly seen, that merge with a neighbour, or whose other sides look like the floor.
/// @param grid grid of the map (100: occupied)
std::vector<Eigen::Vector2d> occupiedWithoutOutline(const dataset::OccupancyGrid& grid,
                                                    const std::vector<dataset::MapObject>& objects);

}  // namespace omnifleet::global_merger
