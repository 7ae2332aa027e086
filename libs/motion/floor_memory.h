#pragma once

#include <opencv2/core.hpp>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/pose2.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::motion {

/// Local occupancy window of one robot: cells in `map` around it, updated by its own scans. A cell is
/// occupied where scans saw a solid object, until they see floor there. Robots are not solid, and cells that
/// were never seen count as free. The window serves path search, not mapping: an error of half a cell does
/// not matter, and cells that leave the window are forgotten.
class FloorMemory {
 public:
  struct Options {
    double cell_m = 0.05;
    double window_m = 12.0;  ///< m, side of the window, which is roughly centred on the robot
    double sight_m = 2.5;    ///< m, range up to which the scan is used

    static Options read(const options::Section& section);
  };

  explicit FloorMemory(const Options& options);

  /// Adds the scan of one frame. A cell is occupied after two hits.
  void see(const Pose2& map_from_base, const Scan& scan);
  /// Frees the cells within a radius of a place (map, metres) that is occupied by a robot.
  void clear(const Eigen::Vector2d& place_m, double radius_m);
  void forget();

  double cell_m() const { return options_.cell_m; }
  /// Column and row of the cell that contains a point (map, metres). The cell may lie outside the window.
  Eigen::Vector2i cellOf(const Eigen::Vector2d& place_m) const;
  Eigen::Vector2d centreOf(const Eigen::Vector2i& cell) const;
  bool isInside(const Eigen::Vector2i& cell) const;
  /// Distance from the centre of each cell to that of the nearest occupied one, metres; the window size if no
  /// cell is occupied.
  const cv::Mat1f& clearance_m() const;
  /// Clearance of the cell that contains a point (map, metres); the window size if the point is outside the
  /// window.
  double clearanceAt(const Eigen::Vector2d& place_m) const;

 private:
  void moveTo(const Eigen::Vector2d& here_m);
  void clearSeen(const Pose2& map_from_base, const Scan& scan);
  void markHits(const Pose2& map_from_base, const Scan& scan);

  Options options_;
  Eigen::Vector2i first_ =
      Eigen::Vector2i::Zero();  ///< first cell of the window, in the unbounded grid of the map
  bool placed_ = false;
  cv::Mat1b seen_;  ///< hits of each cell, minus the scans that saw floor there
  cv::Mat1b hit_;   ///< cells hit by the current scan
  mutable cv::Mat1b free_;
  mutable cv::Mat1f clearance_m_;
  mutable bool is_current_ = false;
};

}  // namespace omnifleet::motion
