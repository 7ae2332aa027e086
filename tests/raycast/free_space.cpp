#include "tests/raycast/free_space.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>

namespace omnifleet::raycast {

FreeSpace::FreeSpace(const House& house, double clearance_m) {
  low_ = house.rooms.front().low;
  Eigen::Vector2d high = house.rooms.front().high;
  for (const Extent& room : house.rooms) low_ = low_.cwiseMin(room.low), high = high.cwiseMax(room.high);
  columns_ = static_cast<int>((high.x() - low_.x()) / kCell_m);
  rows_ = static_cast<int>((high.y() - low_.y()) / kCell_m);
  free_.resize(static_cast<std::size_t>(columns_ * rows_));
  for (int y = 0; y < rows_; ++y) {
    for (int x = 0; x < columns_; ++x) {
      const Eigen::Vector2d at = middle(x, y);
      bool free = at.x() > low_.x() + clearance_m && at.y() > low_.y() + clearance_m &&
                  at.x() < high.x() - clearance_m && at.y() < high.y() - clearance_m;
      for (const auto* list : {&house.walls, &house.furniture})
        for (const Solid& solid : *list) free = free && distanceTo(solid, at) > clearance_m;
      free_[index(x, y)] = free ? 1 : 0;
    }
  }
  keepLargest();
}

double FreeSpace::share() const {
  return static_cast<double>(std::count(free_.begin(), free_.end(), 1)) / static_cast<double>(free_.size());
}

Eigen::Vector2d FreeSpace::anywhere(Random& random) const {
  for (;;) {
    const int x = random.below(columns_), y = random.below(rows_);
    if (free_[index(x, y)] != 0) return middle(x, y);
  }
}

bool FreeSpace::isFree(const Eigen::Vector2d& at) const {
  const int x = static_cast<int>((at.x() - low_.x()) / kCell_m),
            y = static_cast<int>((at.y() - low_.y()) / kCell_m);
  return isInside(x, y) && free_[index(x, y)] != 0;
}

Eigen::Vector2d FreeSpace::nearestFree(const Eigen::Vector2d& at) const {
  Eigen::Vector2d nearest = at;
  double least_m2 = std::numeric_limits<double>::infinity();
  for (std::size_t k = 0; k < free_.size(); ++k) {
    const double away_m2 = (middle(k) - at).squaredNorm();
    if (free_[k] != 0 && away_m2 < least_m2) nearest = middle(k), least_m2 = away_m2;
  }
  return nearest;
}

bool FreeSpace::isClear(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
  const int steps = std::max(1, static_cast<int>((b - a).norm() / (0.5 * kCell_m)));
  for (int k = 0; k <= steps; ++k)
    if (!isFree(a + (b - a) * (static_cast<double>(k) / steps))) return false;
  return true;
}

std::vector<Eigen::Vector2d> FreeSpace::cellsBetween(std::size_t begin, std::size_t end) const {
  std::vector<double> cost(free_.size(), std::numeric_limits<double>::infinity());
  std::vector<std::size_t> before(free_.size(), free_.size());
  using Entry = std::pair<double, std::size_t>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  cost[begin] = 0.0;
  open.push({0.0, begin});
  while (!open.empty()) {
    const auto [so_far, at] = open.top();
    open.pop();
    if (at == end) break;
    if (so_far > cost[at]) continue;
    const int x = static_cast<int>(at) % columns_, y = static_cast<int>(at) / columns_;
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const int u = x + dx, v = y + dy;
        if (!isInside(u, v) || free_[index(u, v)] == 0) continue;
        const double next = so_far + std::hypot(dx, dy);
        if (next >= cost[index(u, v)]) continue;
        cost[index(u, v)] = next;
        before[index(u, v)] = at;
        open.push({next, index(u, v)});
      }
    }
  }
  if (!std::isfinite(cost[end])) return {};
  std::vector<Eigen::Vector2d> cells;
  for (std::size_t at = end; at != begin; at = before[at]) cells.push_back(middle(at));
  std::reverse(cells.begin(), cells.end());
  return cells;
}

std::vector<Eigen::Vector2d> FreeSpace::path(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
  const auto cell = [&](const Eigen::Vector2d& at) {
    return index(std::clamp(static_cast<int>((at.x() - low_.x()) / kCell_m), 0, columns_ - 1),
                 std::clamp(static_cast<int>((at.y() - low_.y()) / kCell_m), 0, rows_ - 1));
  };
  std::vector<Eigen::Vector2d> way, cells = cellsBetween(cell(from), cell(to));
  Eigen::Vector2d at = from;
  if (cells.empty() && !isFree(from)) {  // a robot that cut a corner and stopped there returns first
    way.push_back(at = nearestFree(from));
    cells = cellsBetween(cell(at), cell(to));
  }
  for (std::size_t k = 0; k < cells.size();) {
    std::size_t last = k;
    for (std::size_t j = k; j < cells.size(); ++j)
      if (isClear(at, cells[j])) last = j;
    at = cells[last];
    way.push_back(at);
    k = last + 1;
  }
  return way;
}

std::vector<std::size_t> FreeSpace::areaAround(std::size_t seed, std::vector<char>& seen) const {
  std::vector<std::size_t> area{seed};
  seen[seed] = 1;
  for (std::size_t k = 0; k < area.size(); ++k) {
    const int x = static_cast<int>(area[k]) % columns_, y = static_cast<int>(area[k]) / columns_;
    const int next[4][2] = {{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}};
    for (const auto& [u, v] : next) {
      if (!isInside(u, v) || free_[index(u, v)] == 0 || seen[index(u, v)] != 0) continue;
      seen[index(u, v)] = 1;
      area.push_back(index(u, v));
    }
  }
  return area;
}

/// Places that cannot be reached from the largest free area are not free.
void FreeSpace::keepLargest() {
  std::vector<char> seen(free_.size(), 0);
  std::vector<std::size_t> largest;
  for (std::size_t seed = 0; seed < free_.size(); ++seed) {
    if (free_[seed] == 0 || seen[seed] != 0) continue;
    std::vector<std::size_t> area = areaAround(seed, seen);
    if (area.size() > largest.size()) largest = std::move(area);
  }
  std::fill(free_.begin(), free_.end(), static_cast<std::uint8_t>(0));
  for (const std::size_t at : largest) free_[at] = 1;
}

}  // namespace omnifleet::raycast
