#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstdint>
#include <string>
#include <vector>

namespace omnifleet::structure {

enum class Cell : std::uint8_t { kUnknown, kFree, kOccupied };

/// Where rays ended in one occupied cell.
struct SurfaceCell {
  int x = 0, y = 0;                                  ///< cell
  Eigen::Vector2d mean_m = Eigen::Vector2d::Zero();  ///< map; weighted mean of the ends of rays
  double sigma_m = 0.0;            ///< of the mean, one direction; keyframes are independent
  std::uint32_t observations = 0;  ///< number of keyframes
  std::uint64_t observers = 0;     ///< bit per robot
};

/// Ends of a gap in a wall that can be a mirror (mirrors.h), map.
struct PossibleMirror {
  Eigen::Vector2d from_m, to_m;
  Eigen::Vector2d middle() const { return 0.5 * (from_m + to_m); }
};

/// Cells of an occupancy map with the surfaces found in them.
struct SurfaceMap {
  std::vector<std::string> robots;  ///< of the bits of SurfaceCell::observers
  double resolution_m = 0.05;
  Eigen::Vector2d origin_m = Eigen::Vector2d::Zero();  ///< lower-left corner of cell (0, 0), map
  int width = 0, height = 0;
  std::vector<Cell> cells;  ///< index = x + y·width
  std::vector<SurfaceCell>
      surface;  ///< of the occupied cells with ray ends; any order; an occupied cell may have none
  std::vector<PossibleMirror> mirrors;
  std::vector<std::uint8_t>
      mirrored;  ///< per cell: 1 if it is unknown because of a mirror; empty if there is none

  /// Index of the cell at a place, map; −1 outside.
  int indexAt(const Eigen::Vector2d& at_m) const {
    const Eigen::Vector2d cell = (at_m - origin_m) / resolution_m;
    const int x = static_cast<int>(std::floor(cell.x())), y = static_cast<int>(std::floor(cell.y()));
    return x < 0 || y < 0 || x >= width || y >= height ? -1 : x + y * width;
  }
  Cell cellAt(const Eigen::Vector2d& at_m) const {
    const int at = indexAt(at_m);
    return at < 0 ? Cell::kUnknown : cells[static_cast<std::size_t>(at)];
  }
  /// Whether a place lies behind a possible mirror.
  bool isMirrored(const Eigen::Vector2d& at_m) const {
    const int at = mirrored.empty() ? -1 : indexAt(at_m);
    return at >= 0 && mirrored[static_cast<std::size_t>(at)] != 0;
  }
};

}  // namespace omnifleet::structure
