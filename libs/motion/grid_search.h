#pragma once

#include <opencv2/core.hpp>

#include <Eigen/Core>
#include <cstdint>
#include <vector>

namespace omnifleet::motion {

/// The cheapest way over the cells of a grid, to all eight sides (A*; Hart, Nilsson and Raphael 1968).
/// Buffers are kept from one search to the next; equal ways are chosen between by the cells' order, so the
/// same grid gives the same way.
class GridSearch {
 public:
  struct Result {
    bool reaches = false;  ///< the way ends at the goal; else at the cell nearest to it that can be got to
    double cost = 0.0;     ///< of the way, in cells
    std::vector<Eigen::Vector2i> cells;  ///< column, row: from the start on; empty where it stays there
  };

  /// `price`: per cell, of going a cell's width on it, at least 1; infinity where nobody may go. Both cells
  /// must be inside of the grid; the start's own price is not asked.
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
  std::vector<Open> open_;  ///< a heap
  std::vector<float> cost_;
  std::vector<std::int32_t> before_;
  std::vector<std::uint8_t> done_;
  Result result_;
};

}  // namespace omnifleet::motion
