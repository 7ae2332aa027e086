#include "evaluation/cell_metrics.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <optional>
#include <set>

#include "evaluation/trajectory_metrics.h"

namespace omnifleet::evaluation {

namespace {

using Eigen::Vector2d;
using Square = Eigen::AlignedBox2d;

constexpr std::int8_t kFreeCell = 0, kOccupiedCell = 100;
constexpr double kRounding_m = 1e-9;  // a distance equal to a limit is within it
constexpr double kInfinite = std::numeric_limits<double>::infinity();

struct Face {
  Vector2d from, to;
};

/// A true obstacle, an outline of the run, or the room, in the frame of the run.
struct Region {
  Polygon outline;
  Square box;
  std::vector<Face> faces;

  bool holds(const Vector2d& at) const { return box.contains(at) && contains(outline, at); }
};

double crossProduct(const Vector2d& a, const Vector2d& b) {
  return a.x() * b.y() - a.y() * b.x();
}

Region regionInMap(const Polygon& polygon, const Pose2& map_from_truth) {
  Region made;
  for (const Vector2d& vertex : polygon) made.outline.push_back(map_from_truth * vertex);
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    made.box.extend(made.outline[i]);
    made.faces.push_back({made.outline[i], made.outline[(i + 1) % polygon.size()]});
  }
  return made;
}

std::vector<Region> obstaclesInMap(const std::vector<dataset::MapObject>& objects,
                                   const Pose2& map_from_truth) {
  std::vector<Region> made;
  for (const dataset::MapObject& object : objects) {
    if (object.kind == "obstacle" && object.outline_m.size() > 2)
      made.push_back(regionInMap(object.outline_m, map_from_truth));
  }
  return made;
}

/// Where two segments meet, as a share of the first one. Parallel segments do not meet.
std::optional<double> crossing(const Face& a, const Face& b) {
  const Vector2d along = a.to - a.from, other = b.to - b.from, between = b.from - a.from;
  const double area = crossProduct(along, other);
  if (std::abs(area) < 1e-12) return std::nullopt;
  const double t = crossProduct(between, other) / area, u = crossProduct(between, along) / area;
  if (t < 0.0 || t > 1.0 || u < 0.0 || u > 1.0) return std::nullopt;
  return t;
}

bool segmentsMeet(const Face& a, const Face& b) {
  return crossing(a, b).has_value();
}

double pointToFace(const Vector2d& point, const Face& face) {
  const Vector2d along = face.to - face.from;
  const double square = along.squaredNorm();
  const double t = square > 0.0 ? std::clamp(along.dot(point - face.from) / square, 0.0, 1.0) : 0.0;
  return (face.from + t * along - point).norm();
}

/// 0 where the face crosses or touches the square.
double squareToFace(const Square& square, const Face& face) {
  const std::array<Vector2d, 4> corners{square.corner(Square::BottomLeft), square.corner(Square::BottomRight),
                                        square.corner(Square::TopRight), square.corner(Square::TopLeft)};
  double nearest_m = std::min(square.exteriorDistance(face.from), square.exteriorDistance(face.to));
  for (std::size_t i = 0; i < 4; ++i) {
    if (segmentsMeet({corners[i], corners[(i + 1) % 4]}, face)) return 0.0;
    nearest_m = std::min(nearest_m, pointToFace(corners[i], face));
  }
  return nearest_m;
}

/// Exact up to `limit_m`; beyond it, any value above it.
double squareToRegions(const Square& square, const std::vector<Region>& regions, double limit_m) {
  double nearest_m = kInfinite;
  for (const Region& region : regions) {
    if (square.exteriorDistance(region.box) > std::min(nearest_m, limit_m)) continue;
    for (const Face& face : region.faces) nearest_m = std::min(nearest_m, squareToFace(square, face));
  }
  return nearest_m;
}

/// Cells of one grid in its own frame.
class Cells {
 public:
  explicit Cells(const dataset::OccupancyGrid& grid) : grid_(grid) {}

  /// The squares of all cells with one value.
  std::vector<Square> squares(std::int8_t value) const {
    std::vector<Square> found;
    for (int y = 0; y < grid_.height; ++y) {
      for (int x = 0; x < grid_.width; ++x)
        if (valueAt(x, y) == value) found.push_back(square(x, y));
    }
    return found;
  }
  Eigen::Vector2i at(const Vector2d& point) const {
    return ((point - grid_.origin_m) / grid_.resolution_m).array().floor().cast<int>();
  }
  bool hasOccupiedWithin(double distance_m, const Vector2d& point) const {
    const Vector2d reach = Vector2d::Constant(distance_m + kRounding_m);
    const Eigen::Vector2i low = at(point - reach), high = at(point + reach);
    for (int y = low.y(); y <= high.y(); ++y) {
      for (int x = low.x(); x <= high.x(); ++x)
        if (valueAt(x, y) == kOccupiedCell && square(x, y).exteriorDistance(point) <= reach.x()) return true;
    }
    return false;
  }

  Square square(int x, int y) const {
    const Vector2d corner = grid_.origin_m + grid_.resolution_m * Vector2d(x, y);
    return {corner, corner + Vector2d::Constant(grid_.resolution_m)};
  }
  std::int8_t valueAt(int x, int y) const {
    if (x < 0 || y < 0 || x >= grid_.width || y >= grid_.height) return -1;
    return grid_.cells[static_cast<std::size_t>(y) * static_cast<std::size_t>(grid_.width) +
                       static_cast<std::size_t>(x)];
  }

 private:
  const dataset::OccupancyGrid& grid_;
};

/// Another robot at the time of a view.
struct Body {
  Region region;
  double height_m;
};

/// A robot's camera at one of its positions.
struct View {
  Pose2 base, camera;
  double half_view_rad, height_m;
  std::vector<Body> others;

  bool shows(const Vector2d& point) const { return isInView(point) && !isBehindRobot(point); }

 private:
  bool isInView(const Vector2d& point) const {
    if (half_view_rad >= M_PI) return true;
    const Vector2d seen = camera.inverse() * point;
    return std::abs(std::atan2(seen.y(), seen.x())) <= half_view_rad;
  }
  /// The line of sight sinks from the camera to the floor at the point. A body hides the point if the line
  /// leaves it below its top.
  bool isBehindRobot(const Vector2d& point) const {
    const Face line{camera.translation(), point};
    return std::any_of(others.begin(), others.end(), [&](const Body& body) {
      double leaves = -1.0;
      for (const Face& face : body.region.faces)
        leaves = std::max(leaves, crossing(line, face).value_or(-1.0));
      return leaves >= 0.0 && height_m * (1.0 - leaves) < body.height_m;
    });
  }
};

/// Lines of sight between cameras of robots and points of faces.
class Sight {
 public:
  Sight(const std::vector<Region>& obstacles, const std::vector<Region>& rooms,
        const std::vector<View>& views)
      : obstacles_(obstacles), rooms_(rooms), views_(views) {}

  /// Smallest limit of kSeen_m and kCrossed_m within which a position sees the point; infinite if none does.
  double seenWithin(const Vector2d& point, const Face& own) {
    double within_m = kInfinite;
    for (const View& view : views_) {
      const Vector2d position = view.camera.translation();
      const double distance_m = (position - point).norm() - kRounding_m;
      const double limit_m =
          distance_m <= CellMetrics::kSeen_m ? CellMetrics::kSeen_m : CellMetrics::kCrossed_m;
      if (distance_m > limit_m || limit_m >= within_m || !view.shows(point) ||
          isBlocked(position, point, own))
        continue;
      within_m = limit_m;
      if (within_m == CellMetrics::kSeen_m) break;
    }
    return within_m;
  }
  bool isSeenClose(const Vector2d& point, const Face& own) {
    return std::any_of(views_.begin(), views_.end(), [&](const View& view) {
      const Vector2d position = view.camera.translation();
      return (position - point).norm() <= CellMetrics::kClose_m && view.shows(point) &&
             !isBlocked(position, point, own);
    });
  }

 private:
  bool isBlocked(const Vector2d& position, const Vector2d& point, const Face& own) {
    const double length_m = (point - position).norm();
    if (length_m <= CellMetrics::kEnd_m) return false;
    const Face line{position, point - CellMetrics::kEnd_m / length_m * (point - position)};
    // Neighbouring lines mostly end at the same face.
    if (last_ && last_ != &own && segmentsMeet(line, *last_)) return true;
    return isBlockedBy(obstacles_, line, own) || isBlockedBy(rooms_, line, own);
  }
  bool isBlockedBy(const std::vector<Region>& regions, const Face& line, const Face& own) {
    const Square box(line.from.cwiseMin(line.to), line.from.cwiseMax(line.to));
    for (const Region& region : regions) {
      if (!box.intersects(region.box)) continue;
      for (const Face& face : region.faces) {
        if (&face == &own || !segmentsMeet(line, face)) continue;
        last_ = &face;
        return true;
      }
    }
    return false;
  }

  const std::vector<Region>&obstacles_, &rooms_;
  const std::vector<View>& views_;
  const Face* last_ = nullptr;
};

/// The other robots whose body and height are known, at a time.
std::vector<Body> bodiesAt(TimeNs time_ns, const std::map<std::string, TrueRobot>& robots,
                           const std::string& viewer, const Pose2& map_from_truth) {
  constexpr TimeNs kMostGap_ns = 1'000'000'000;
  std::vector<Body> bodies;
  for (const auto& [name, robot] : robots) {
    Pose2 pose;
    if (name == viewer || robot.body_m.size() < 3 || robot.body_height_m <= 0.0) continue;
    if (!poseAt(robot.path, time_ns, kMostGap_ns, pose)) continue;
    bodies.push_back({regionInMap(robot.body_m, map_from_truth * pose), robot.body_height_m});
  }
  return bodies;
}

/// Views of all robots with a camera, at least kPathStep_m or kTurnStep_rad apart along each path.
std::vector<View> viewsInMap(const std::map<std::string, TrueRobot>& robots, const Pose2& map_from_truth) {
  std::vector<View> used;
  for (const auto& [name, robot] : robots) {
    if (robot.half_view_rad <= 0.0) continue;
    const std::size_t first = used.size();
    for (const dataset::StampedPose& pose : robot.path) {
      const Pose2 at = map_from_truth * pose.map_from_base;
      if (used.size() > first) {
        const Pose2 way = used.back().base.inverse() * at;
        const bool moved = way.translation().norm() >= CellMetrics::kPathStep_m - kRounding_m;
        const bool turned =
            robot.half_view_rad < M_PI && std::abs(way.theta_rad) >= CellMetrics::kTurnStep_rad;
        if (!moved && !turned) continue;
      }
      used.push_back({at, at * robot.base_from_camera, robot.half_view_rad, robot.camera_height_m, {}});
      if (robot.camera_height_m > 0.0)
        used.back().others = bodiesAt(pose.time_ns, robots, name, map_from_truth);
    }
  }
  return used;
}

/// A share over cells or points; NaN without any.
double shareOf(int part, int whole) {
  return whole > 0 ? static_cast<double>(part) / whole : std::numeric_limits<double>::quiet_NaN();
}

/// Numerators of the shares of FaceMetrics.
struct FaceCounts {
  int cells = 0, tight = 0, near = 0, wide = 0, seen = 0, seen_occupied = 0;

  void addCell(double distance_m) {
    ++cells;
    tight += distance_m <= CellMetrics::kTight_m + kRounding_m;
    near += distance_m <= CellMetrics::kNear_m + kRounding_m;
    wide += distance_m <= CellMetrics::kWide_m + kRounding_m;
  }
  void operator+=(const FaceCounts& other) {
    cells += other.cells;
    tight += other.tight;
    near += other.near;
    wide += other.wide;
    seen += other.seen;
    seen_occupied += other.seen_occupied;
  }
  FaceMetrics metrics() const {
    return {cells, shareOf(tight, cells),       shareOf(near, cells), shareOf(wide, cells),
            seen,  shareOf(seen_occupied, seen)};
  }
};

/// Adds the seen points of the faces to the counts and the cells they lie in to `crossed`.
void countSeen(const std::vector<Region>& regions, const Cells& cells, Sight& sight, FaceCounts& counts,
               std::set<std::pair<int, int>>& crossed) {
  for (const Region& region : regions) {
    for (const Face& face : region.faces) {
      const Vector2d along = face.to - face.from;
      const int steps = std::max(1, static_cast<int>(std::lround(along.norm() / CellMetrics::kFaceStep_m)));
      for (int k = 0; k < steps; ++k) {
        const Vector2d point = face.from + (k + 0.5) / steps * along;
        const double within_m = sight.seenWithin(point, face);
        if (within_m == kInfinite) continue;
        const Eigen::Vector2i cell = cells.at(point);
        crossed.emplace(cell.x(), cell.y());
        if (within_m > CellMetrics::kSeen_m) continue;
        ++counts.seen;
        counts.seen_occupied += cells.hasOccupiedWithin(CellMetrics::kNear_m, point);
      }
    }
  }
}

bool isInAny(const std::vector<Region>& regions, const Vector2d& at) {
  return std::any_of(regions.begin(), regions.end(), [&](const Region& region) { return region.holds(at); });
}

/// The truth and the outlines of the run, in the frame of the run.
struct Regions {
  std::vector<Region> obstacles, rooms, outlines;
};

/// The face nearest to a square, and the point of it that is nearest to the square's centre.
std::pair<const Face*, Vector2d> nearestFace(const Square& square, const Regions& regions) {
  const Face* nearest = nullptr;
  double nearest_m = kInfinite;
  for (const auto* all : {&regions.obstacles, &regions.rooms}) {
    for (const Region& region : *all) {
      if (square.exteriorDistance(region.box) > nearest_m) continue;
      for (const Face& face : region.faces) {
        const double face_m = pointToFace(square.center(), face);
        if (face_m >= nearest_m) continue;
        nearest_m = face_m;
        nearest = &face;
      }
    }
  }
  if (!nearest) return {nullptr, square.center()};
  const Vector2d along = nearest->to - nearest->from;
  const double length = std::max(along.squaredNorm(), 1e-12);
  const double t = std::clamp(along.dot(square.center() - nearest->from) / length, 0.0, 1.0);
  return {nearest, nearest->from + t * along};
}

struct Mean {
  double sum = 0.0;
  int count = 0;
  void add(double value) {
    sum += value;
    ++count;
  }
  double value() const { return count > 0 ? sum / count : std::numeric_limits<double>::quiet_NaN(); }
};

void countOccupied(const Cells& cells, const Regions& regions, Sight& sight, CellMetrics& metrics,
                   FaceCounts& at_obstacles, FaceCounts& at_structure) {
  Mean close, distant;
  for (const Square& square : cells.squares(kOccupiedCell)) {
    ++metrics.occupied;
    const double obstacle_m = squareToRegions(square, regions.obstacles, kInfinite);
    const double structure_m = squareToRegions(square, regions.rooms, obstacle_m);
    const double face_m = std::min(obstacle_m, structure_m);
    if (face_m > 0.0 && isInAny(regions.obstacles, square.center()) &&
        isInAny(regions.outlines, square.center())) {
      ++metrics.filled;
    } else if (face_m < kInfinite) {
      (obstacle_m <= structure_m ? at_obstacles : at_structure).addCell(face_m);
      const auto [face, point] = nearestFace(square, regions);
      (face && sight.isSeenClose(point, *face) ? close : distant).add(face_m);
    }
  }
  metrics.near_error_m = close.value();
  metrics.far_error_m = distant.value();
}

/// Occupied cells whose centre lay in the body of a robot at one of its true poses.
int countOnRobots(const Cells& cells, const std::map<std::string, TrueRobot>& robots,
                  const Pose2& map_from_truth) {
  constexpr double kStep_m = 0.02, kTurn_rad = 0.05;  // between the poses that are compared
  std::vector<Region> bodies;
  for (const auto& [name, robot] : robots) {
    if (robot.body_m.size() < 3) continue;
    std::optional<Pose2> last;
    for (const dataset::StampedPose& pose : robot.path) {
      const Pose2 at = map_from_truth * pose.map_from_base;
      if (last) {
        const Pose2 way = last->inverse() * at;
        if (way.translation().norm() < kStep_m && std::abs(way.theta_rad) < kTurn_rad) continue;
      }
      last = at;
      bodies.push_back(regionInMap(robot.body_m, at));
    }
  }
  const auto occupied = cells.squares(kOccupiedCell);
  return static_cast<int>(std::count_if(occupied.begin(), occupied.end(), [&](const Square& square) {
    return isInAny(bodies, square.center());
  }));
}

/// Share of the floor of the room whose cell is free.
double shareComplete(const Cells& cells, double resolution_m, const Regions& regions) {
  if (regions.rooms.empty()) return std::numeric_limits<double>::quiet_NaN();
  const Square& box = regions.rooms.front().box;
  const Eigen::Vector2i low = cells.at(box.min()), high = cells.at(box.max());
  int floor = 0, free = 0;
  for (int y = low.y(); y <= high.y(); ++y) {
    for (int x = low.x(); x <= high.x(); ++x) {
      const Square square = cells.square(x, y);
      // A cell that a face crosses is rightly occupied.
      if (!isInAny(regions.rooms, square.center()) || isInAny(regions.obstacles, square.center())) continue;
      if (squareToRegions(square, regions.obstacles, resolution_m) <= 0.0) continue;
      if (squareToRegions(square, regions.rooms, resolution_m) <= 0.0) continue;
      ++floor;
      free += cells.valueAt(x, y) == kFreeCell;
    }
  }
  return shareOf(free, floor);
}

int countFreeWrong(const std::vector<Square>& free, const Regions& regions) {
  return static_cast<int>(std::count_if(free.begin(), free.end(), [&](const Square& square) {
    return isInAny(regions.obstacles, square.center()) ||
           (!regions.rooms.empty() && !isInAny(regions.rooms, square.center()));
  }));
}

}  // namespace

CellMetrics compareCells(const dataset::OccupancyGrid& grid, const Pose2& truth_from_map,
                         const std::vector<dataset::MapObject>& found,
                         const std::vector<dataset::MapObject>& scene, const Polygon& room,
                         const std::map<std::string, TrueRobot>& robots) {
  const Pose2 map_from_truth = truth_from_map.inverse();
  Regions regions{obstaclesInMap(scene, map_from_truth), {}, obstaclesInMap(found, map_from_truth)};
  if (!room.empty()) regions.rooms.push_back(regionInMap(room, map_from_truth));
  const Cells cells(grid);
  CellMetrics metrics;
  FaceCounts at_obstacles, at_structure;
  const std::vector<View> views = viewsInMap(robots, map_from_truth);
  Sight sight(regions.obstacles, regions.rooms, views);
  countOccupied(cells, regions, sight, metrics, at_obstacles, at_structure);
  metrics.on_robots = countOnRobots(cells, robots, map_from_truth);

  std::set<std::pair<int, int>> crossed;
  countSeen(regions.obstacles, cells, sight, at_obstacles, crossed);
  countSeen(regions.rooms, cells, sight, at_structure, crossed);
  metrics.obstacles = at_obstacles.metrics();
  metrics.structure = at_structure.metrics();
  at_obstacles += at_structure;
  metrics.all = at_obstacles.metrics();
  metrics.crossed = static_cast<int>(crossed.size());
  metrics.occupied_per_crossed = shareOf(metrics.occupied - metrics.filled, metrics.crossed);

  const auto free = cells.squares(kFreeCell);
  metrics.free = static_cast<int>(free.size());
  metrics.free_wrong = shareOf(countFreeWrong(free, regions), metrics.free);
  metrics.free_complete = shareComplete(cells, grid.resolution_m, regions);
  return metrics;
}

}  // namespace omnifleet::evaluation
