#include "tests/experiments/exploration/coverage.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace omnifleet::exploration {
namespace {

constexpr double kPhantom_m = 0.03;       // an occupied cell farther from all faces is wrong
constexpr double kInside_m = 0.02;        // a free cell deeper in a solid is wrong
constexpr int kPlaces = 5, kSamples = 2;  // every n-th cell: places to look from, floor to look at

double toOutline(const Polygon& polygon, const Eigen::Vector2d& at) {
  double least_m = INFINITY;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i], way = polygon[(i + 1) % polygon.size()] - a;
    const double along = std::clamp((at - a).dot(way) / std::max(1e-12, way.squaredNorm()), 0.0, 1.0);
    least_m = std::min(least_m, (at - a - along * way).norm());
  }
  return least_m;
}

/// Distance to the next solid or wall; negative inside of them.
double clearance(const TrueRoom& room, const Eigen::Vector2d& at) {
  double least_m = toOutline(room.room_m, at);
  if (!contains(room.room_m, at)) least_m = -least_m;
  for (const Polygon& solid : room.solids_m) {
    const double to_m = toOutline(solid, at);
    least_m = std::min(least_m, contains(solid, at) ? -to_m : to_m);
  }
  return least_m;
}

Eigen::Vector2d centre(const Eigen::Vector2d& origin_m, int column, int row) {
  return origin_m + ReachableFloor::kCell_m * Eigen::Vector2d(column + 0.5, row + 0.5);
}

cv::Mat1b connected(const cv::Mat1b& open, const TrueRoom& room, const Eigen::Vector2d& origin_m) {
  cv::Mat1b reached = cv::Mat1b::zeros(open.size());
  std::deque<cv::Point> next;
  for (const Pose2& start : room.starts) {
    const Eigen::Vector2d at = (start.translation() - origin_m) / ReachableFloor::kCell_m;
    const cv::Point cell(static_cast<int>(at.x()), static_cast<int>(at.y()));
    reached(cell) = 1;
    next.push_back(cell);
  }
  const cv::Rect all({0, 0}, open.size());
  while (!next.empty()) {
    const cv::Point at = next.front();
    next.pop_front();
    for (const cv::Point way : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      const cv::Point to = at + way;
      if (!all.contains(to) || reached(to) || !open(to)) continue;
      reached(to) = 1;
      next.push_back(to);
    }
  }
  return reached;
}

bool isClear(const cv::Mat1f& clear_m, const cv::Point& from, const cv::Point& to) {
  const cv::Point way = to - from;
  const int steps = std::max(std::abs(way.x), std::abs(way.y));
  for (int i = 1; i < steps; ++i) {
    const cv::Point at(from.x + static_cast<int>(std::lround(static_cast<double>(way.x) * i / steps)),
                       from.y + static_cast<int>(std::lround(static_cast<double>(way.y) * i / steps)));
    if (clear_m(at) <= 0.0F) return false;
  }
  return true;
}

cv::Mat1b visibleFrom(const cv::Mat1b& reached, const cv::Mat1f& clear_m, double sight_m) {
  std::vector<cv::Point> places;
  for (int row = 0; row < reached.rows; row += kPlaces)
    for (int column = 0; column < reached.cols; column += kPlaces)
      if (reached(row, column)) places.emplace_back(column, row);
  cv::Mat1b visible = cv::Mat1b::zeros(reached.size());
  const double most = sight_m / ReachableFloor::kCell_m;
  for (int row = 0; row < reached.rows; row += kSamples)
    for (int column = 0; column < reached.cols; column += kSamples) {
      const cv::Point to(column, row);
      if (clear_m(to) <= 0.0F) continue;
      const bool seen = std::any_of(places.begin(), places.end(), [&](const cv::Point& from) {
        return cv::norm(to - from) <= most && isClear(clear_m, from, to);
      });
      if (!seen) continue;
      for (int y = 0; y < kSamples; ++y)
        for (int x = 0; x < kSamples; ++x) {
          const cv::Point at(std::min(column + x, reached.cols - 1), std::min(row + y, reached.rows - 1));
          if (clear_m(at) > 0.0F) visible(at) = 1;
        }
    }
  return visible;
}

/// −1 unknown, 0 free … 100 occupied.
std::int8_t valueAt(const dataset::OccupancyGrid& map, const Eigen::Vector2d& at_m) {
  const Eigen::Array2d cell = ((at_m - map.origin_m) / map.resolution_m).array().floor();
  const auto x = static_cast<int>(cell.x()), y = static_cast<int>(cell.y());
  if (x < 0 || y < 0 || x >= map.width || y >= map.height) return -1;
  return map
      .cells[static_cast<std::size_t>(x) + static_cast<std::size_t>(y) * static_cast<std::size_t>(map.width)];
}

}  // namespace

ReachableFloor ReachableFloor::of(const TrueRoom& room, double reach_m, double margin_m, double sight_m) {
  ReachableFloor floor;
  Eigen::Vector2d low = room.room_m.front(), high = low;
  for (const Eigen::Vector2d& vertex : room.room_m) {
    low = low.cwiseMin(vertex);
    high = high.cwiseMax(vertex);
  }
  floor.origin_m = low;
  const cv::Size size(static_cast<int>(std::lround((high.x() - low.x()) / kCell_m)),
                      static_cast<int>(std::lround((high.y() - low.y()) / kCell_m)));
  cv::Mat1f clear_m(size);
  for (int row = 0; row < size.height; ++row)
    for (int column = 0; column < size.width; ++column)
      clear_m(row, column) = static_cast<float>(clearance(room, centre(low, column, row)));
  const cv::Mat1b open = clear_m >= reach_m + margin_m;
  const cv::Mat1b reached = connected(open, room, low);
  cv::Mat1f to_place;
  cv::distanceTransform(reached == 0, to_place, cv::DIST_L2, cv::DIST_MASK_PRECISE);
  floor.covered = (to_place * kCell_m <= reach_m + margin_m) & (clear_m > 0.0F);
  floor.visible = visibleFrom(reached, clear_m, sight_m);
  return floor;
}

Coverage compare(const dataset::OccupancyGrid& map, const ReachableFloor& floor, const TrueRoom& room) {
  Coverage coverage;
  const auto share = [&](const cv::Mat1b& mask, double& all_m2) {
    int all = 0, known = 0;
    for (int row = 0; row < mask.rows; ++row)
      for (int column = 0; column < mask.cols; ++column) {
        if (!mask(row, column)) continue;
        ++all;
        known += valueAt(map, centre(floor.origin_m, column, row)) >= 0;
      }
    all_m2 = all * ReachableFloor::kCell_m * ReachableFloor::kCell_m;
    return static_cast<double>(known) / std::max(1, all);
  };
  coverage.covered_share = share(floor.covered, coverage.covered_m2);
  coverage.visible_share = share(floor.visible, coverage.visible_m2);
  for (int y = 0; y < map.height; ++y)
    for (int x = 0; x < map.width; ++x) {
      const Eigen::Vector2d at = map.origin_m + map.resolution_m * Eigen::Vector2d(x + 0.5, y + 0.5);
      const int value = valueAt(map, at);
      if (value < 0) continue;
      const double clear_m = clearance(room, at);
      const bool wrong = value > 50 ? std::abs(clear_m) > kPhantom_m : clear_m < -kInside_m;
      if (wrong) coverage.wrong_m2 += map.resolution_m * map.resolution_m;
    }
  return coverage;
}

void drawMissing(const dataset::OccupancyGrid& map, const ReachableFloor& floor, const std::string& path) {
  constexpr int kScale = 4;
  cv::Mat3b picture(floor.covered.size());
  for (int row = 0; row < picture.rows; ++row)
    for (int column = 0; column < picture.cols; ++column) {
      const std::int8_t value = valueAt(map, centre(floor.origin_m, column, row));
      cv::Vec3b colour = value < 0    ? cv::Vec3b(215, 210, 205)
                         : value > 50 ? cv::Vec3b(60, 50, 45)
                                      : cv::Vec3b(255, 255, 255);
      if (value < 0 && floor.visible(row, column)) colour = {60, 160, 250};
      if (value < 0 && floor.covered(row, column)) colour = {50, 50, 230};
      picture(picture.rows - 1 - row, column) = colour;
    }
  cv::Mat3b large;
  cv::resize(picture, large, {}, kScale, kScale, cv::INTER_NEAREST);
  if (!cv::imwrite(path, large)) throw std::runtime_error(path + ": cannot be written");
}

}  // namespace omnifleet::exploration
