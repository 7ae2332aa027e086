#pragma once

#include <opencv2/core.hpp>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/pose2.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::motion {

/// What a robot has seen of the floor around it, from wherever it was: a window of cells in `map` that goes
/// along with it. Occupied is a cell where scans saw something solid, until they see floor there. Robots are
/// nothing solid; what nobody has seen counts as free. It is for finding ways, not for maps: half a cell off
/// does not matter, and what leaves the window is forgotten.
class FloorMemory {
 public:
  struct Options {
    double cell_m = 0.05;
    double window_m = 12.0;  ///< m, side of the window, the robot about its middle
    double sight_m = 2.5;    ///< m, the scan is believed so far

    static Options read(const options::Section& section);
  };

  explicit FloorMemory(const Options& options);

  /// One frame's scan. A cell is occupied once two scans agree.
  void see(const Pose2& map_from_base, const Scan& scan);
  /// Takes out what lies within a radius of a place (map, metres): a robot is there.
  void clear(const Eigen::Vector2d& place_m, double radius_m);
  void forget();

  double cell_m() const { return options_.cell_m; }
  /// Column and row of the cell that holds a point (map, metres); it may lie outside of the window.
  Eigen::Vector2i cellOf(const Eigen::Vector2d& place_m) const;
  Eigen::Vector2d centreOf(const Eigen::Vector2i& cell) const;
  bool isInside(const Eigen::Vector2i& cell) const;
  /// Metres from the middle of each cell to that of the next occupied one; the window's size where nothing
  /// is.
  const cv::Mat1f& clearance_m() const;
  /// Likewise from any point; outside of the window everything is free.
  double clearanceAt(const Eigen::Vector2d& place_m) const;

 private:
  void moveTo(const Eigen::Vector2d& here_m);
  void clearSeen(const Pose2& map_from_base, const Scan& scan);
  void markHits(const Pose2& map_from_base, const Scan& scan);

  Options options_;
  Eigen::Vector2i first_ =
      Eigen::Vector2i::Zero();  ///< in the map's endless grid, of the window's first cell
  bool placed_ = false;
  cv::Mat1b seen_;  ///< how often something solid was seen, less what was seen free
  cv::Mat1b hit_;   ///< in this scan
  mutable cv::Mat1b free_;
  mutable cv::Mat1f clearance_m_;
  mutable bool is_current_ = false;
};

}  // namespace omnifleet::motion
