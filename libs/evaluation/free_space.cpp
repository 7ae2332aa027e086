#include "evaluation/free_space.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::evaluation {

namespace {

constexpr std::int8_t kFree = 0, kOccupied = 100;

/// Centres of the cells with one value, in the frame of the truth.
std::vector<Eigen::Vector2d> middlesOf(const dataset::OccupancyGrid& grid, const Pose2& truth_from_map,
                                       std::int8_t value) {
  std::vector<Eigen::Vector2d> middles;
  for (std::size_t i = 0; i < grid.cells.size(); ++i) {
    if (grid.cells[i] != value) continue;
    const auto width = static_cast<std::size_t>(grid.width);
    const Eigen::Vector2d cell(static_cast<double>(i % width), static_cast<double>(i / width));
    middles.push_back(truth_from_map *
                      Eigen::Vector2d(grid.origin_m + grid.resolution_m * (cell.array() + 0.5).matrix()));
  }
  return middles;
}

/// Share of points, one cell apart along the outline, that have a point of `occupied` within kAtWall_m.
double shareFound(const Polygon& room, const std::vector<Eigen::Vector2d>& occupied, double step_m) {
  int points = 0, found = 0;
  for (std::size_t i = 0; i < room.size(); ++i) {
    const Eigen::Vector2d from = room[i], edge = room[(i + 1) % room.size()] - from;
    const int steps = std::max(1, static_cast<int>(std::lround(edge.norm() / step_m)));
    for (int k = 0; k < steps; ++k) {
      const Eigen::Vector2d at = from + (k + 0.5) / steps * edge;
      ++points;
      found += std::any_of(occupied.begin(), occupied.end(), [&](const Eigen::Vector2d& cell) {
        return (cell - at).norm() <= FreeSpaceMetrics::kAtWall_m;
      });
    }
  }
  return static_cast<double>(found) / points;
}

}  // namespace

FreeSpaceMetrics compareFreeSpace(const dataset::OccupancyGrid& grid, const Pose2& truth_from_map,
                                  const std::vector<dataset::MapObject>& scene, const Polygon& room) {
  const auto free = middlesOf(grid, truth_from_map, kFree);
  const double cell_m2 = grid.resolution_m * grid.resolution_m;
  const auto areaOf = [&](const auto& counts) {
    return cell_m2 * static_cast<double>(std::count_if(free.begin(), free.end(), counts));
  };
  FreeSpaceMetrics metrics;
  metrics.free_m2 = cell_m2 * static_cast<double>(free.size());
  metrics.in_obstacles_m2 = areaOf([&](const Eigen::Vector2d& middle) {
    return std::any_of(scene.begin(), scene.end(), [&](const dataset::MapObject& object) {
      return object.kind == "obstacle" && contains(object.outline_m, middle);
    });
  });
  if (room.empty()) return metrics;
  metrics.outside_m2 = areaOf([&](const Eigen::Vector2d& middle) { return !contains(room, middle); });
  metrics.walls_found = shareFound(room, middlesOf(grid, truth_from_map, kOccupied), grid.resolution_m);
  return metrics;
}

}  // namespace omnifleet::evaluation
