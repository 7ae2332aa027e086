#pragma once

#include <Eigen/Core>
#include <vector>

#include "dataset/map_files.h"

// Where the map may show less than there is.

namespace omnifleet::global_merger {

/// Less than 10 cm thin and more than twice as long: a board, or the dark side of a thing that else looks
/// like the floor, of which the map shows no more.
bool isSliver(const Polygon& outline_m);

/// Middles (map, metres) of what is occupied in a map but has no outline: cells that hang together, farther
/// than 5 cm from every object, at most 80 cm long and no straight line, which is a piece of a wall. Things
/// that were hardly seen, that run together with what is beside them, or whose other sides look like the
/// floor.
/// @param grid of the map (100: occupied)
std::vector<Eigen::Vector2d> bareCells(const dataset::OccupancyGrid& grid,
                                       const std::vector<dataset::MapObject>& objects);

}  // namespace omnifleet::global_merger
