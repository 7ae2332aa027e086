#pragma once

#include <opencv2/core.hpp>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/polygon.h"
#include "geometry/pose2.h"
#include "motion/formation_types.h"
#include "options/options.h"

namespace omnifleet::motion {

enum class Cell : std::uint8_t { kUnknown = 0, kFree, kOccupied };

/// What the robots of a fleet know about the floor: cells of a fixed area of `map`, unknown until a view
/// shows them. Every formation service draws the views of all robots at their published poses, so all grids
/// are equal. Robots are not solid: they are known by their poses. The grid serves exploration, not mapping.
///
/// A cell is free once a view has shown floor at its centre, and occupied while the hits in it outweigh that
/// (one hit adds 2, floor subtracts 1; FloorMemory). Floor that the own body hides (View::blind_m) counts as
/// free where the view passes over it: an object there would hide the floor behind it, unless it is lower
/// than the line of sight. It frees no occupied cell.
class ExplorationGrid {
 public:
  struct Options {
    double cell_m = 0.04;
    Eigen::Vector2d centre_m{0.0, 0.0};  ///< map
    Eigen::Vector2d size_m{8.0, 8.0};    ///< floor outside this rectangle is not explored
    double sight_m = 2.0;                ///< m, range up to which a view is used
    double robot_m = 0.03;               ///< m, hits within this distance of a robot's outline belong to it
    double hit_cells = 0.2;  ///< cells: a range whose σ is larger shows floor, but its end is not a hit

    static Options read(const options::Section& section);
  };

  explicit ExplorationGrid(const Options& options);

  /// Draws one view. `robots` (map): outlines of all robots at that time; hits within `robot_m` of them are
  /// hits of the robot.
  void see(const Pose2& map_from_base, const View& view, const std::vector<Polygon>& robots);
  /// A robot stands here: the floor under its outline (map) is free.
  void stand(const Polygon& outline_m);
  /// Unknown floor within a radius of a place (map) counts as free.
  void assumeFree(const Eigen::Vector2d& place_m, double radius_m);

  const Options& options() const { return options_; }
  double cell_m() const { return options_.cell_m; }
  cv::Size size() const { return cells_.size(); }
  Eigen::Vector2i cellOf(const Eigen::Vector2d& place_m) const;
  Eigen::Vector2d centreOf(const Eigen::Vector2i& cell) const;
  bool isInside(const Eigen::Vector2i& cell) const;
  Cell at(const Eigen::Vector2i& cell) const { return static_cast<Cell>(cells_(cell.y(), cell.x())); }
  /// All cells, each a Cell.
  const cv::Mat1b& cells() const { return cells_; }
  /// Distance from the centre of each cell to that of the nearest occupied or unknown cell, metres. Floor
  /// outside the area counts as unknown.
  const cv::Mat1f& occupiedClearance_m() const;
  const cv::Mat1f& unknownClearance_m() const;
  /// Centres (map) of the occupied cells within a radius of a place.
  void occupiedNear(const Eigen::Vector2d& place_m, double radius_m,
                    std::vector<Eigen::Vector2d>& centres_m) const;

 private:
  template <typename Visit>
  void forCellsNear(const Eigen::Vector2d& place_m, double radius_m, Visit visit) const;
  void markHits(const Pose2& map_from_base, const View& view, const std::vector<Polygon>& robots);
  void markFloor(const Pose2& map_from_base, const View& view);
  void classify(const Eigen::Vector2i& cell);

  Options options_;
  Eigen::Vector2i first_;  ///< of the area, in the unbounded grid of `map`
  cv::Mat1b hits_;         ///< hits of each cell minus the views that showed floor there
  cv::Mat1b floor_;        ///< 1: floor was seen at the centre
  cv::Mat1b cells_;
  cv::Mat1b hit_now_;
  std::vector<std::uint8_t> is_hit_;  ///< per ray of the current view
  mutable cv::Mat1b mask_;
  mutable cv::Mat1f occupied_clearance_m_, unknown_clearance_m_;
  mutable bool occupied_is_current_ = false, unknown_is_current_ = false;
};

}  // namespace omnifleet::motion
