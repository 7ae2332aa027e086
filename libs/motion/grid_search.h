#pragma once

#include <opencv2/core.hpp>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace omnifleet::motion {

/// Cheapest path over the cells of a grid, 8-connected (A*; Hart, Nilsson and Raphael 1968). Buffers are
/// reused between searches. Ties are resolved by the order of the cells, so the same grid gives the same
/// path.
class GridSearch {
 public:
  struct Result {
    bool reaches = false;  ///< the path ends at the goal; otherwise at the reachable cell nearest to it
    double cost = 0.0;     ///< of the path, in cells
    std::vector<Eigen::Vector2i>
        cells;  ///< column, row; without the start cell; empty if the path stays there
  };

  /// `price`: cost of crossing one cell width on each cell, at least 1; infinity if the cell is forbidden.
  /// Both cells must lie inside the grid. The price of the start cell is not used.
  const Result& find(const cv::Mat1f& price, const Eigen::Vector2i& from, const Eigen::Vector2i& goal);

 private:
  struct Open {
    float estimate;
    std::int32_t cell;
    bool operator<(const Open& other) const {
      return estimate != other.estimate ? estimate > other.estimate : cell > other.cell;
    }
  };

  void push(const Eigen::Vector2i& cell, float cost);
  void start(const cv::Mat1f& price, const Eigen::Vector2i& from, const Eigen::Vector2i& goal);
  void expand(const cv::Mat1f& price, std::int32_t at);
  void trace(std::int32_t last);
  Eigen::Vector2i cellAt(std::int32_t index) const { return {index % columns_, index / columns_}; }
  std::int32_t indexOf(const Eigen::Vector2i& cell) const { return cell.y() * columns_ + cell.x(); }
  double toGoal(const Eigen::Vector2i& cell) const { return (cell - goal_).cast<double>().norm(); }

  int columns_ = 0;
  Eigen::Vector2i goal_ = Eigen::Vector2i::Zero();
  std::vector<Open> open_;  ///< binary heap
  std::vector<float> cost_;
  std::vector<std::int32_t> before_;
  std::vector<std::uint8_t> done_;
  Result result_;
};

}  // namespace omnifleet::motion
