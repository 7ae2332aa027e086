#pragma once

#include <opencv2/core.hpp>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace omnifleet::motion {

/// Cheapest paths from one cell to all cells of a grid, 8-connected (Dijkstra 1959). Buffers are reused. Ties
/// are resolved by the order of the cells.
class DistanceField {
 public:
  /// `price`: cost of crossing one cell width on each cell; infinity if the cell is forbidden. The price of
  /// the start cell is not used.
  void from(const cv::Mat1f& price, const Eigen::Vector2i& start);
  /// Cost in cell widths; infinity if no path leads there.
  float cost(const Eigen::Vector2i& cell) const { return cost_[index(cell)]; }
  bool reaches(const Eigen::Vector2i& cell) const;
  /// Cells from the start (excluded) to `cell`; empty if no path leads there or the path stays.
  std::vector<Eigen::Vector2i> pathTo(const Eigen::Vector2i& cell) const;

 private:
  struct Open {
    float cost;
    std::int32_t cell;
    bool operator<(const Open& other) const {
      return cost != other.cost ? cost > other.cost : cell > other.cell;
    }
  };
  std::size_t index(const Eigen::Vector2i& cell) const {
    return static_cast<std::size_t>(cell.y() * columns_ + cell.x());
  }

  int columns_ = 0;
  std::vector<Open> open_;  ///< binary heap
  std::vector<float> cost_;
  std::vector<std::int32_t> before_;
};

}  // namespace omnifleet::motion
