#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/polygon.h"
#include "geometry/pose2.h"
#include "observation/observation.h"

namespace omnifleet::formation {

/// A test arena like that of Ahmed et al. 2013: 3 × 2 m within a wall, walls of blocks and free-standing
/// blocks, two robots that drive and two that are parked. Shares no code with libs/synthetic.
struct BlockArena {
  double width_m = 3.0, depth_m = 2.0;  ///< x and y from 0
  std::vector<Polygon> blocks_m;        ///< map; the outer wall is four blocks around the floor
  std::vector<Pose2> robots;            ///< initial poses; the first `driving` drive, the others are parked
  std::size_t driving = 2;

  /// Nearest distance of an outline (map) to a block.
  double distanceToBlocks(const Polygon& outline_m) const;
  /// Range of a ray to the blocks; `limit_m` if it hits none.
  double range(const Eigen::Vector2d& from_m, const Eigen::Vector2d& unit, double limit_m) const;
};

/// Body of a small tracked robot; base_link is behind its middle.
RobotBody trackedRobot();

/// An arena by seed. Two obstacles touch or leave a passage of at least `passage_m`.
BlockArena randomArena(std::uint32_t seed, double passage_m = 0.42);
/// Nothing but the outer wall, two driving robots.
BlockArena emptyArena();

/// Free floor that a driving robot can see from somewhere. A robot can be where the circle about its
/// base_link keeps `margin_m` from blocks and parked robots, connected to its initial pose. Cells of
/// `cell_m`, row 0 at y = 0; nonzero: reachable.
cv::Mat1b visibleFloor(const BlockArena& arena, double cell_m, double margin_m, double sight_m);

/// Range along a ray to a polygon; `limit_m` if it misses it.
double rangeTo(const Polygon& polygon, const Eigen::Vector2d& from_m, const Eigen::Vector2d& unit,
               double limit_m);

}  // namespace omnifleet::formation
