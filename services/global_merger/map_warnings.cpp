#include "global_merger/map_warnings.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::global_merger {

namespace {

constexpr std::int8_t kOccupiedCell = 100;
constexpr double kBesideObject_m = 0.05;  // m beside an object: the noise of its outline
constexpr std::size_t kLeastCells = 5;    // fewer are noise
constexpr float kLongest_m = 0.8f, kLine_m = 0.1f;

cv::Mat1b occupiedOf(const dataset::OccupancyGrid& grid) {
  cv::Mat1b occupied(grid.height, grid.width, std::uint8_t{0});
  for (int y = 0; y < grid.height; ++y)
    for (int x = 0; x < grid.width; ++x)
      occupied(y, x) = grid.cells[static_cast<std::size_t>(y * grid.width + x)] == kOccupiedCell ? 255 : 0;
  return occupied;
}

cv::Mat1b nearObjects(const dataset::OccupancyGrid& grid, const std::vector<dataset::MapObject>& objects) {
  cv::Mat1b near(grid.height, grid.width, std::uint8_t{0});
  for (const dataset::MapObject& object : objects) {
    std::vector<cv::Point> outline;
    for (const Eigen::Vector2d& p : object.outline_m) {
      const Eigen::Vector2d at = (p - grid.origin_m) / grid.resolution_m;
      outline.emplace_back(static_cast<int>(std::floor(at.x())), static_cast<int>(std::floor(at.y())));
    }
    if (!outline.empty()) cv::fillPoly(near, std::vector<std::vector<cv::Point>>{outline}, cv::Scalar(255));
  }
  const int reach = static_cast<int>(std::ceil(kBesideObject_m / grid.resolution_m));
  cv::dilate(near, near, cv::getStructuringElement(cv::MORPH_ELLIPSE, {2 * reach + 1, 2 * reach + 1}));
  return near;
}

/// @param cells at least one, in cells of the grid
bool isObject(const std::vector<cv::Point>& cells, double resolution_m) {
  if (cells.size() < kLeastCells) return false;
  const cv::Size2f size = cv::minAreaRect(cells).size * static_cast<float>(resolution_m);
  return std::max(size.width, size.height) <= kLongest_m && std::min(size.width, size.height) >= kLine_m;
}

}  // namespace

bool isSliver(const Polygon& outline_m) {
  constexpr float kThin_m = 0.1f, kLong = 2.0f;
  if (outline_m.size() < 3) return false;
  std::vector<cv::Point2f> points;
  for (const Eigen::Vector2d& p : outline_m)
    points.emplace_back(static_cast<float>(p.x()), static_cast<float>(p.y()));
  const cv::Size2f size = cv::minAreaRect(points).size;
  const auto [width, length] = std::minmax(size.width, size.height);
  return width < kThin_m && length > kLong * width;
}

std::vector<Eigen::Vector2d> occupiedWithoutOutline(const dataset::OccupancyGrid& grid,
                                                    const std::vector<dataset::MapObject>& objects) {
  if (grid.width == 0) return {};
  const cv::Mat1b bare = occupiedOf(grid) & ~nearObjects(grid, objects);
  cv::Mat1b joined;
  cv::dilate(bare, joined, cv::Mat());  // bridges a cell that was missed
  cv::Mat1i label;
  std::vector<std::vector<cv::Point>> parts(static_cast<std::size_t>(cv::connectedComponents(joined, label)));
  for (int y = 0; y < bare.rows; ++y)
    for (int x = 0; x < bare.cols; ++x)
      if (bare(y, x) != 0) parts[static_cast<std::size_t>(label(y, x))].emplace_back(x, y);
  std::vector<Eigen::Vector2d> middles_m;
  for (const auto& part : parts) {
    if (!isObject(part, grid.resolution_m)) continue;
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const cv::Point& cell : part) sum += Eigen::Vector2d(cell.x + 0.5, cell.y + 0.5);
    middles_m.emplace_back(grid.origin_m + grid.resolution_m / static_cast<double>(part.size()) * sum);
  }
  return middles_m;
}

}  // namespace omnifleet::global_merger
