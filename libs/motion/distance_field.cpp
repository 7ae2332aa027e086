#include "motion/distance_field.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace omnifleet::motion {

void DistanceField::from(const cv::Mat1f& price, const Eigen::Vector2i& start) {
  columns_ = price.cols;
  cost_.assign(price.total(), std::numeric_limits<float>::infinity());
  before_.assign(price.total(), -1);
  open_.assign(1, {0.0f, static_cast<std::int32_t>(index(start))});
  cost_[index(start)] = 0.0f;
  while (!open_.empty()) {
    std::pop_heap(open_.begin(), open_.end());
    const Open now = open_.back();
    open_.pop_back();
    if (now.cost > cost_[static_cast<std::size_t>(now.cell)]) continue;
    const int column = now.cell % columns_, row = now.cell / columns_;
    for (int k = 0; k < 9; ++k) {
      const int x = column + k % 3 - 1, y = row + k / 3 - 1;
      if (k == 4 || x < 0 || y < 0 || x >= price.cols || y >= price.rows) continue;
      const float way = k % 2 == 0 ? static_cast<float>(M_SQRT2) : 1.0f;
      const float cost = now.cost + way * price(y, x);
      const auto next = static_cast<std::int32_t>(y * columns_ + x);
      if (!(cost < cost_[static_cast<std::size_t>(next)])) continue;
      cost_[static_cast<std::size_t>(next)] = cost;
      before_[static_cast<std::size_t>(next)] = now.cell;
      open_.push_back({cost, next});
      std::push_heap(open_.begin(), open_.end());
    }
  }
}

bool DistanceField::reaches(const Eigen::Vector2i& cell) const {
  return std::isfinite(cost(cell));
}

std::vector<Eigen::Vector2i> DistanceField::pathTo(const Eigen::Vector2i& cell) const {
  std::vector<Eigen::Vector2i> path;
  for (auto i = static_cast<std::int32_t>(index(cell)); before_[static_cast<std::size_t>(i)] >= 0;
       i = before_[static_cast<std::size_t>(i)])
    path.emplace_back(i % columns_, i / columns_);
  std::reverse(path.begin(), path.end());
  return path;
}

}  // namespace omnifleet::motion
