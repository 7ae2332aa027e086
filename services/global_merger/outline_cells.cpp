#include "global_merger/outline_cells.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <set>

namespace omnifleet::global_merger {
namespace {

cv::Mat1b occupiedCells(const structure::SurfaceMap& map) {
  cv::Mat1b occupied(map.height, map.width, std::uint8_t{0});
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x) {
      const auto at = static_cast<std::size_t>(y * map.width + x);
      occupied(y, x) = map.cells[at] == structure::Cell::kOccupied ? 255 : 0;
    }
  return occupied;
}

/// Places every half cell along an outline.
std::vector<Eigen::Vector2d> placesAlong(const Polygon& outline_m, double step_m) {
  std::vector<Eigen::Vector2d> places;
  for (std::size_t i = 0; i < outline_m.size(); ++i) {
    const Eigen::Vector2d& a = outline_m[i];
    const Eigen::Vector2d along = outline_m[(i + 1) % outline_m.size()] - a;
    const int steps = std::max(1, static_cast<int>(std::ceil(along.norm() / step_m)));
    for (int k = 0; k < steps; ++k) places.emplace_back(a + along * ((k + 0.5) / steps));
  }
  return places;
}

}  // namespace

std::vector<OutlineCells> cellsAt(const std::vector<Polygon>& outlines_m, const structure::SurfaceMap& map) {
  std::vector<OutlineCells> all(outlines_m.size());
  if (map.width == 0) return all;
  const cv::Mat1b occupied = occupiedCells(map);
  cv::Mat1i part;
  const auto parts = static_cast<std::size_t>(cv::connectedComponents(occupied, part, 8));
  std::vector<int> in_part(parts, 0), at_outlines(parts, 0);
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x) ++in_part[static_cast<std::size_t>(part(y, x))];
  cv::Mat1b counted(occupied.size(), std::uint8_t{0});
  std::vector<std::set<std::size_t>> parts_at(outlines_m.size());
  const int reach = static_cast<int>(std::ceil(OutlineCells::kBeside));
  for (std::size_t i = 0; i < outlines_m.size(); ++i) {
    const auto places = placesAlong(outlines_m[i], 0.5 * map.resolution_m);
    int seen = 0;
    for (const Eigen::Vector2d& place : places) {
      const Eigen::Vector2d at = (place - map.origin_m) / map.resolution_m;
      const int x = static_cast<int>(std::floor(at.x())), y = static_cast<int>(std::floor(at.y()));
      bool found = false;
      for (int v = std::max(0, y - reach); v <= std::min(map.height - 1, y + reach); ++v) {
        for (int u = std::max(0, x - reach); u <= std::min(map.width - 1, x + reach); ++u) {
          const double away = (Eigen::Vector2d(u + 0.5, v + 0.5) - at).norm();
          if (occupied(v, u) == 0 || away > OutlineCells::kBeside) continue;
          found = true;
          const auto k = static_cast<std::size_t>(part(v, u));
          parts_at[i].insert(k);
          if (counted(v, u) == 0) ++at_outlines[k];
          counted(v, u) = 255;
        }
      }
      seen += found ? 1 : 0;
    }
    if (!places.empty()) all[i].seen = seen / static_cast<double>(places.size());
  }
  for (std::size_t i = 0; i < outlines_m.size(); ++i) {
    int cells = 0, covered = 0;
    for (const std::size_t k : parts_at[i]) cells += in_part[k], covered += at_outlines[k];
    if (cells > 0) all[i].alone = covered / static_cast<double>(cells);
  }
  return all;
}

}  // namespace omnifleet::global_merger
