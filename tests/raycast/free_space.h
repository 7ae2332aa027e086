#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "tests/raycast/furnished_room.h"

namespace omnifleet::raycast {

/// Cells of 5 cm whose middles keep a clearance from walls and furniture; only the largest connected area.
class FreeSpace {
 public:
  FreeSpace(const House& house, double clearance_m);

  double share() const;  ///< of all cells
  Eigen::Vector2d anywhere(Random& random) const;
  bool isFree(const Eigen::Vector2d& at) const;
  Eigen::Vector2d nearestFree(const Eigen::Vector2d& at) const;
  /// True if all places on the straight line are free.
  bool isClear(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const;
  /// Shortest path over the cells (Dijkstra), straightened; empty if there is none.
  std::vector<Eigen::Vector2d> path(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const;

 private:
  static constexpr double kCell_m = 0.05;
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y * columns_ + x); }
  bool isInside(int x, int y) const { return x >= 0 && y >= 0 && x < columns_ && y < rows_; }
  Eigen::Vector2d middle(int x, int y) const { return low_ + kCell_m * Eigen::Vector2d(x + 0.5, y + 0.5); }
  Eigen::Vector2d middle(std::size_t at) const {
    return middle(static_cast<int>(at) % columns_, static_cast<int>(at) / columns_);
  }
  void keepLargest();
  std::vector<std::size_t> areaAround(std::size_t seed, std::vector<char>& seen) const;
  std::vector<Eigen::Vector2d> cellsBetween(std::size_t begin, std::size_t end) const;

  Eigen::Vector2d low_;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> free_;
};

}  // namespace omnifleet::raycast
