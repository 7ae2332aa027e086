#include "block_arena.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <random>

#include "motion/motion_guard.h"

namespace omnifleet::formation {
namespace {

constexpr double kWallM = 0.08;  // thickness of blocks in walls

Polygon box(const Pose2& pose, double length_m, double width_m) {
  const double x = 0.5 * length_m, y = 0.5 * width_m;
  return motion::placed(pose, {{-x, -y}, {x, -y}, {x, y}, {-x, y}});
}

std::vector<Polygon> outerWall(double width_m, double depth_m) {
  const double t = 0.1;
  return {box({0.5 * width_m, -0.5 * t, 0.0}, width_m + 2 * t, t),
          box({0.5 * width_m, depth_m + 0.5 * t, 0.0}, width_m + 2 * t, t),
          box({-0.5 * t, 0.5 * depth_m, 0.0}, t, depth_m),
          box({width_m + 0.5 * t, 0.5 * depth_m, 0.0}, t, depth_m)};
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

double reach() {
  return motion::reachOf(trackedRobot().outline());
}

/// Cells whose circle keeps the margin, connected to the driving robots.
cv::Mat1b reachableCells(const BlockArena& arena, double cell_m, double margin_m) {
  const cv::Size size(static_cast<int>(std::lround(arena.width_m / cell_m)),
                      static_cast<int>(std::lround(arena.depth_m / cell_m)));
  const auto centre = [&](int column, int row) {
    return Eigen::Vector2d((column + 0.5) * cell_m, (row + 0.5) * cell_m);
  };
  std::vector<Polygon> solids = arena.blocks_m;
  for (std::size_t i = arena.driving; i < arena.robots.size(); ++i)
    solids.push_back(motion::placed(arena.robots[i], trackedRobot().outline()));
  cv::Mat1b open(size), reached = cv::Mat1b::zeros(size);
  for (int row = 0; row < size.height; ++row)
    for (int column = 0; column < size.width; ++column)
      open(row, column) = std::all_of(solids.begin(), solids.end(), [&](const Polygon& solid) {
        return distanceTo(solid, centre(column, row)) >= reach() + margin_m;
      });
  std::deque<cv::Point> next;
  for (std::size_t i = 0; i < arena.driving; ++i) {
    const cv::Point start(static_cast<int>(arena.robots[i].x_m / cell_m),
                          static_cast<int>(arena.robots[i].y_m / cell_m));
    next.push_back(start);
    reached(start) = 1;
  }
  while (!next.empty()) {
    const cv::Point at = next.front();
    next.pop_front();
    for (const cv::Point way : {cv::Point(1, 0), cv::Point(-1, 0), cv::Point(0, 1), cv::Point(0, -1)}) {
      const cv::Point to = at + way;
      if (!cv::Rect({0, 0}, size).contains(to) || reached(to) || !open(to)) continue;
      reached(to) = 1;
      next.push_back(to);
    }
  }
  return reached;
}

class Builder {
 public:
  Builder(std::uint32_t seed, double passage_m) : random_(seed), passage_m_(passage_m) {
    arena_.blocks_m = outerWall(arena_.width_m, arena_.depth_m);
  }

  BlockArena build() {
    const int walls = integer(2, 3), blocks = integer(2, 4);
    for (int i = 0; i < walls; ++i) tryTo([&] { return wall(); });
    for (int i = 0; i < blocks; ++i)
      tryTo([&] {
        return add(
            box({uniform(0.3, arena_.width_m - 0.3), uniform(0.3, arena_.depth_m - 0.3), uniform(-3.1, 3.1)},
                uniform(0.10, 0.30), uniform(0.08, 0.20)),
            0.0);
      });
    for (int i = 0; i < 4; ++i) tryTo([&] { return robot(i >= 2); });
    return arena_;
  }
  bool complete() const { return arena_.robots.size() == 4; }

 private:
  double uniform(double a, double b) { return std::uniform_real_distribution<double>(a, b)(random_); }
  int integer(int a, int b) { return std::uniform_int_distribution<int>(a, b)(random_); }
  template <typename Attempt>
  void tryTo(Attempt attempt) {
    for (int i = 0; i < 200 && !attempt(); ++i) {
    }
  }

  /// A wall of blocks that begins at the outer wall.
  bool wall() {
    const double length_m = uniform(0.5, 1.1);
    const int side = integer(0, 3);
    const double along = uniform(0.5, (side < 2 ? arena_.width_m : arena_.depth_m) - 0.5);
    const double middle = 0.5 * length_m;
    if (side == 0) return add(box({along, middle, M_PI_2}, length_m, kWallM), 0.01);
    if (side == 1) return add(box({along, arena_.depth_m - middle, M_PI_2}, length_m, kWallM), 0.01);
    if (side == 2) return add(box({middle, along, 0.0}, length_m, kWallM), 0.01);
    return add(box({arena_.width_m - middle, along, 0.0}, length_m, kWallM), 0.01);
  }

  bool add(const Polygon& solid, double touching_m) {
    for (const Polygon& other : arena_.blocks_m) {
      const double gap_m = motion::distanceBetween(solid, other);
      if (gap_m > touching_m && gap_m < passage_m_) return false;
      if (gap_m <= 0.0 && touching_m <= 0.0) return false;
    }
    arena_.blocks_m.push_back(solid);
    return true;
  }

  /// Parked robots may stand beside a block.
  bool robot(bool parked) {
    const Pose2 pose{uniform(0.15, arena_.width_m - 0.15), uniform(0.15, arena_.depth_m - 0.15),
                     uniform(-3.1, 3.1)};
    const Polygon outline = motion::placed(pose, trackedRobot().outline());
    const auto fits = [&](double gap_m) {
      return parked ? gap_m >= passage_m_ || (gap_m > 0.02 && gap_m < 0.08) : gap_m >= 0.16;
    };
    for (const Polygon& block : arena_.blocks_m) {
      if (!fits(motion::distanceBetween(outline, block))) return false;
    }
    for (const Pose2& other : arena_.robots) {
      if (motion::distanceBetween(outline, motion::placed(other, trackedRobot().outline())) < passage_m_)
        return false;
    }
    arena_.robots.push_back(pose);
    return true;
  }

  std::mt19937 random_;
  double passage_m_;
  BlockArena arena_;
};

}  // namespace

RobotBody trackedRobot() {
  RobotBody body;
  body.footprint_m = {{-0.05, -0.055}, {0.08, -0.055}, {0.08, 0.055}, {-0.05, 0.055}};
  body.height_m = 0.10;
  body.wheel_separation_m = 0.09;
  return body;
}

double rangeTo(const Polygon& polygon, const Eigen::Vector2d& from_m, const Eigen::Vector2d& unit,
               double limit_m) {
  double range_m = limit_m;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i] - from_m, way = polygon[(i + 1) % polygon.size()] - polygon[i];
    const double det = cross(unit, way);
    if (std::abs(det) < 1e-12) continue;
    const double along_m = cross(a, way) / det, share = cross(a, unit) / det;
    if (along_m > 0.0 && share >= 0.0 && share <= 1.0) range_m = std::min(range_m, along_m);
  }
  return range_m;
}

double BlockArena::range(const Eigen::Vector2d& from_m, const Eigen::Vector2d& unit, double limit_m) const {
  for (const Polygon& block : blocks_m) limit_m = rangeTo(block, from_m, unit, limit_m);
  return limit_m;
}

double BlockArena::distanceToBlocks(const Polygon& outline_m) const {
  double least_m = INFINITY;
  for (const Polygon& block : blocks_m)
    least_m = std::min(least_m, motion::distanceBetween(block, outline_m));
  return least_m;
}

BlockArena randomArena(std::uint32_t seed, double passage_m) {
  for (std::uint32_t attempt = 0;; ++attempt) {
    Builder builder(seed + 100000u * attempt, passage_m);
    const BlockArena arena = builder.build();
    if (builder.complete()) return arena;
  }
}

BlockArena emptyArena() {
  BlockArena arena;
  arena.blocks_m = outerWall(arena.width_m, arena.depth_m);
  arena.robots = {{0.7, 0.6, 0.4}, {2.2, 1.3, -2.0}};
  return arena;
}

cv::Mat1b visibleFloor(const BlockArena& arena, double cell_m, double margin_m, double sight_m) {
  const cv::Mat1b reachable = reachableCells(arena, cell_m, margin_m);
  std::vector<Polygon> solids = arena.blocks_m;
  for (std::size_t i = arena.driving; i < arena.robots.size(); ++i)
    solids.push_back(motion::placed(arena.robots[i], trackedRobot().outline()));
  std::vector<Eigen::Vector2d> places;
  for (int row = 0; row < reachable.rows; row += 2)
    for (int column = 0; column < reachable.cols; column += 2)
      if (reachable(row, column)) places.emplace_back((column + 0.5) * cell_m, (row + 0.5) * cell_m);
  cv::Mat1b visible = cv::Mat1b::zeros(reachable.size());
  for (int row = 0; row < visible.rows; ++row) {
    for (int column = 0; column < visible.cols; ++column) {
      const Eigen::Vector2d to_m((column + 0.5) * cell_m, (row + 0.5) * cell_m);
      if (std::any_of(solids.begin(), solids.end(), [&](const Polygon& s) { return contains(s, to_m); }))
        continue;
      visible(row, column) = std::any_of(places.begin(), places.end(), [&](const Eigen::Vector2d& from_m) {
        const Eigen::Vector2d way_m = to_m - from_m;
        const double range_m = way_m.norm();
        if (range_m > sight_m) return false;
        return std::all_of(solids.begin(), solids.end(), [&](const Polygon& solid) {
          return range_m < 1e-9 || rangeTo(solid, from_m, way_m / range_m, range_m) >= range_m;
        });
      });
    }
  }
  return visible;
}

}  // namespace omnifleet::formation
