#include "motion/grid_search.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

namespace omnifleet::motion {
namespace {

constexpr double kNearer = 1e-6;  // cells

}  // namespace

const GridSearch::Result& GridSearch::find(const cv::Mat1f& price, const Eigen::Vector2i& from,
                                           const Eigen::Vector2i& goal) {
  start(price, from, goal);
  std::int32_t nearest = indexOf(from);
  while (!open_.empty()) {
    std::pop_heap(open_.begin(), open_.end());
    const std::int32_t at = open_.back().cell;
    open_.pop_back();
    if (std::exchange(done_[static_cast<std::size_t>(at)], 1)) continue;
    if (toGoal(cellAt(at)) < toGoal(cellAt(nearest)) - kNearer) nearest = at;
    if (cellAt(at) == goal) break;
    expand(price, at);
  }
  result_.reaches = cellAt(nearest) == goal;
  result_.cost = cost_[static_cast<std::size_t>(nearest)];
  trace(nearest);
  return result_;
}

void GridSearch::start(const cv::Mat1f& price, const Eigen::Vector2i& from, const Eigen::Vector2i& goal) {
  columns_ = price.cols;
  goal_ = goal;
  cost_.assign(price.total(), std::numeric_limits<float>::infinity());
  before_.assign(price.total(), -1);
  done_.assign(price.total(), 0);
  open_.clear();
  cost_[static_cast<std::size_t>(indexOf(from))] = 0.0f;
  push(from, 0.0f);
}

void GridSearch::push(const Eigen::Vector2i& cell, float cost) {
  open_.push_back({cost + static_cast<float>(toGoal(cell)), indexOf(cell)});
  std::push_heap(open_.begin(), open_.end());
}

void GridSearch::expand(const cv::Mat1f& price, std::int32_t at) {
  const Eigen::Vector2i cell = cellAt(at);
  for (int k = 0; k < 9; ++k) {
    const Eigen::Vector2i next = cell + Eigen::Vector2i(k % 3 - 1, k / 3 - 1);
    if (k == 4 || next.minCoeff() < 0 || next.x() >= price.cols || next.y() >= price.rows) continue;
    const auto index = static_cast<std::size_t>(indexOf(next));
    const float way = k % 2 == 0 ? static_cast<float>(M_SQRT2) : 1.0f;
    const float cost = cost_[static_cast<std::size_t>(at)] + way * price(next.y(), next.x());
    if (done_[index] || !(cost < cost_[index])) continue;
    cost_[index] = cost;
    before_[index] = at;
    push(next, cost);
  }
}

void GridSearch::trace(std::int32_t last) {
  result_.cells.clear();
  for (std::int32_t i = last; before_[static_cast<std::size_t>(i)] >= 0;
       i = before_[static_cast<std::size_t>(i)])
    result_.cells.push_back(cellAt(i));
  std::reverse(result_.cells.begin(), result_.cells.end());
}

}  // namespace omnifleet::motion
