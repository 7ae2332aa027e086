#include "surface_scene.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <random>

namespace omnifleet::structure::testing {
namespace {

double turnOf(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c) {
  return (b - a).x() * (c - a).y() - (b - a).y() * (c - a).x();
}

bool areCrossing(const Eigen::Vector2d& a, const Eigen::Vector2d& b, const Eigen::Vector2d& c,
                 const Eigen::Vector2d& d) {
  return turnOf(a, b, c) * turnOf(a, b, d) < 0 && turnOf(c, d, a) * turnOf(c, d, b) < 0;
}

}  // namespace

std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> SurfaceScene::faces() const {
  std::vector<std::pair<Eigen::Vector2d, Eigen::Vector2d>> all;
  std::vector<Polygon> polygons = obstacles;
  polygons.push_back(room);
  for (const Polygon& polygon : polygons)
    for (std::size_t i = 0; i < polygon.size(); ++i)
      all.emplace_back(polygon[i], polygon[(i + 1) % polygon.size()]);
  return all;
}

bool SurfaceScene::isVisible(const Eigen::Vector2d& point) const {
  const auto all = faces();
  return std::any_of(viewpoints.begin(), viewpoints.end(), [&](const Eigen::Vector2d& from) {
    const Eigen::Vector2d before = point + 1e-6 * (from - point);
    return std::none_of(all.begin(), all.end(),
                        [&](const auto& face) { return areCrossing(from, before, face.first, face.second); });
  });
}

SurfaceMap SurfaceScene::map(double resolution_m, double noise_m, unsigned seed) const {
  SurfaceMap map;
  map.resolution_m = resolution_m;
  Eigen::Vector2d low = room.front(), high = room.front();
  for (const Eigen::Vector2d& p : room) low = low.cwiseMin(p), high = high.cwiseMax(p);
  // Multiples of the cell's size, with a margin of two cells.
  map.origin_m = resolution_m * ((low / resolution_m).array().floor() - 2.0).matrix();
  map.width = static_cast<int>(std::ceil((high - map.origin_m).x() / resolution_m)) + 2;
  map.height = static_cast<int>(std::ceil((high - map.origin_m).y() / resolution_m)) + 2;
  map.cells.assign(static_cast<std::size_t>(map.width * map.height), Cell::kUnknown);
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x)
      if (isVisible(map.origin_m + resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5)))
        map.cells[static_cast<std::size_t>(x + y * map.width)] = Cell::kFree;

  std::map<std::pair<int, int>, std::pair<Eigen::Vector2d, int>> ends;
  for (const auto& [a, b] : faces()) {
    const int samples = std::max(1, static_cast<int>((b - a).norm() / 0.001));
    for (int k = 0; k < samples; ++k) {
      const Eigen::Vector2d p = a + (b - a) * ((k + 0.5) / samples);
      if (!isVisible(p)) continue;
      const Eigen::Vector2d at = (p - map.origin_m) / resolution_m;
      const std::pair key{static_cast<int>(std::floor(at.y())), static_cast<int>(std::floor(at.x()))};
      auto& [sum, count] = ends.try_emplace(key, Eigen::Vector2d::Zero(), 0).first->second;
      sum += p;
      ++count;
    }
  }
  std::mt19937 random(seed);
  std::normal_distribution<double> noise(0.0, 1.0);
  for (const auto& [key, sum] : ends) {
    SurfaceCell cell;
    cell.x = key.second;
    cell.y = key.first;
    cell.mean_m = sum.first / sum.second + noise_m * Eigen::Vector2d(noise(random), noise(random));
    cell.sigma_m = noise_m;
    cell.observations = 3;
    cell.observers = 1;
    map.cells[static_cast<std::size_t>(cell.x + cell.y * map.width)] = Cell::kOccupied;
    map.surface.push_back(cell);
  }
  return map;
}

Polygon rectangle(const Eigen::Vector2d& centre, double length_m, double width_m, double angle_rad) {
  const Eigen::Vector2d u(std::cos(angle_rad), std::sin(angle_rad)), v(-u.y(), u.x());
  const Eigen::Vector2d a = 0.5 * length_m * u, b = 0.5 * width_m * v;
  return {centre - a - b, centre + a - b, centre + a + b, centre - a + b};
}

void hideBeyond(SurfaceMap& map, double x_m) {
  const auto isHidden = [&](int x) { return map.origin_m.x() + map.resolution_m * (x + 0.5) > x_m; };
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x)
      if (isHidden(x)) map.cells[static_cast<std::size_t>(x + y * map.width)] = Cell::kUnknown;
  map.surface.erase(std::remove_if(map.surface.begin(), map.surface.end(),
                                   [&](const SurfaceCell& cell) { return isHidden(cell.x); }),
                    map.surface.end());
}

SurfaceMap drawing(const std::vector<std::string>& rows) {
  SurfaceMap map;
  map.resolution_m = 0.1;
  map.width = static_cast<int>(rows.front().size());
  map.height = static_cast<int>(rows.size());
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      const char c = rows[static_cast<std::size_t>(map.height - 1 - y)][static_cast<std::size_t>(x)];
      map.cells.push_back(c == '.' ? Cell::kFree : c == '#' || c == 'o' ? Cell::kOccupied : Cell::kUnknown);
      if (c == '#') map.surface.push_back({x, y, 0.1 * Eigen::Vector2d(x + 0.5, y + 0.5), 0.002, 2, 1});
    }
  }
  return map;
}

}  // namespace omnifleet::structure::testing
