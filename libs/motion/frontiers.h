#pragma once

#include <opencv2/core.hpp>

#include <Eigen/Core>
#include <vector>

#include "motion/exploration_grid.h"

namespace omnifleet::motion {

/// A part of the boundary between free and unknown floor (Yamauchi 1997): unknown cells beside free ones.
struct Frontier {
  std::vector<Eigen::Vector2i> cells;
  Eigen::Vector2d place_m = Eigen::Vector2d::Zero();  ///< map; centre of the cell nearest to their mean
};

/// All frontiers, connected groups of unknown cells with a free 4-neighbour, in the order of their first
/// cells. A group larger than `extent_m` is divided. Groups below `least_cells` are left out.
std::vector<Frontier> findFrontiers(const ExplorationGrid& grid, double extent_m, int least_cells);

/// A place from which a robot sees a frontier.
struct Viewpoint {
  Eigen::Vector2i cell = Eigen::Vector2i::Zero();
  double heading_rad = 0.0;
  double seen = 0.0;  ///< share of the frontier's sampled cells in the field of view
};

/// Where a robot can look at a frontier from.
struct ViewpointOptions {
  double nearest_m = 0.1, farthest_m = 1.0;  ///< m, distance from base_link to the cells
  double field_of_view_rad = 1.5;            ///< rad, of the camera, centred on the heading
};

/// Viewpoints among the cells of `standable` (nonzero: a robot may stand there and can reach it), on every
/// second row and column; and `here` if it is standable. The line of sight crosses free cells only, and none
/// of `opaque` (nonzero: a robot's body), except next to the frontier.
std::vector<Viewpoint> viewpointsOf(const Frontier& frontier, const ExplorationGrid& grid,
                                    const cv::Mat1b& standable, const cv::Mat1b& opaque,
                                    const std::vector<Eigen::Vector2i>& here,
                                    const ViewpointOptions& options);

}  // namespace omnifleet::motion
