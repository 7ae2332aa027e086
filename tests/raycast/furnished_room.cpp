#include "tests/raycast/furnished_room.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <random>
#include <stdexcept>

#include "dataset/writer.h"

namespace omnifleet::raycast {
namespace {

constexpr double kRadius_m = 0.15, kHeight_m = 0.3, kSeparation_m = 0.26, kCamera_m = 0.5;
constexpr double kWallHeight_m = 2.4, kWall_m = 0.1, kDoor_m = 0.95;
constexpr double kClearance_m = 0.28;  // of the robot's centre from everything
constexpr double kSpeed_mps = 0.25, kTurn_radps = 0.8, kDrive_s = 0.02;
constexpr double kApart_m = 0.5;        // centres of two robots
constexpr double kLongest_s = 36000.0;  // of a drive
constexpr int kTicksPerRow = 5;         // wheel rows at 10 Hz
constexpr TimeNs kBegin_ns = 1'000'000'000'000;

class Random {
 public:
  explicit Random(unsigned seed) : engine_(seed) {}
  double between(double low, double high) { return low + (high - low) * (engine_() / 4294967296.0); }
  int below(int n) { return static_cast<int>(engine_() % static_cast<unsigned>(n)); }
  double normal(double sigma) {
    return sigma * std::sqrt(-2.0 * std::log(between(1e-12, 1.0))) * std::cos(between(0.0, 2.0 * M_PI));
  }
  Eigen::Vector3d colour(double low, double high) {
    return {between(low, high), between(low, high), between(low, high)};
  }

 private:
  std::mt19937 engine_;
};

/// Axis-parallel inside of one room.
struct Extent {
  Eigen::Vector2d low, high;
  Eigen::Vector2d size() const { return high - low; }
};

struct House {
  std::vector<Extent> rooms;
  Polygon inside;  ///< of the walls
  std::vector<Solid> walls, furniture;
};

Solid boxOf(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double height_m,
            const Eigen::Vector3d& albedo) {
  Solid solid;
  const Eigen::Vector2d middle = 0.5 * (low + high);
  solid.map_from_solid = {middle.x(), middle.y(), 0.0};
  solid.size_m = high - low;
  solid.height_m = height_m;
  solid.albedo = albedo;
  return solid;
}

double distanceTo(const Solid& solid, const Eigen::Vector2d& at) {
  const Eigen::Vector2d own = solid.map_from_solid.inverse() * at;
  if (solid.round) return own.norm() - 0.5 * solid.size_m.x();
  return (own.cwiseAbs() - 0.5 * solid.size_m).cwiseMax(0.0).norm();
}

/// Walls around one or two rooms side by side; between two a door.
House walled(const FurnishedOptions& options, Random& random) {
  House house;
  const double width = random.between(5.2, 6.4), depth = random.between(4.2, 5.2);
  const Eigen::Vector2d low(-0.5 * width, -0.5 * depth), high = -low;
  house.rooms.push_back({low, high});
  const auto tone = [&] {
    const double light = random.between(0.45, 0.85);
    return Eigen::Vector3d(light * Eigen::Vector3d(random.between(0.75, 1.1), random.between(0.8, 1.05),
                                                   random.between(0.7, 1.1)));
  };
  const auto wall = [&](double x0, double y0, double x1, double y1) {
    if (options.walls) house.walls.push_back(boxOf({x0, y0}, {x1, y1}, kWallHeight_m, tone()));
  };
  double right = high.x();
  if (options.rooms > 1) {
    const double second = random.between(3.0, 4.2);
    right = high.x() + kWall_m + second;
    house.rooms.push_back({{high.x() + kWall_m, low.y()}, {right, high.y()}});
    const double door = random.between(low.y() + 0.6, high.y() - 0.6 - kDoor_m);
    wall(high.x(), low.y(), high.x() + kWall_m, door);
    wall(high.x(), door + kDoor_m, high.x() + kWall_m, high.y());
    house.inside = {{low.x(), low.y()},
                    {high.x(), low.y()},
                    {high.x(), door},
                    {high.x() + kWall_m, door},
                    {high.x() + kWall_m, low.y()},
                    {right, low.y()},
                    {right, high.y()},
                    {high.x() + kWall_m, high.y()},
                    {high.x() + kWall_m, door + kDoor_m},
                    {high.x(), door + kDoor_m},
                    {high.x(), high.y()},
                    {low.x(), high.y()}};
  } else {
    house.inside = {low, {high.x(), low.y()}, high, {low.x(), high.y()}};
  }
  wall(low.x() - kWall_m, low.y() - kWall_m, right + kWall_m, low.y());
  wall(low.x() - kWall_m, high.y(), right + kWall_m, high.y() + kWall_m);
  wall(low.x() - kWall_m, low.y(), low.x(), high.y());
  wall(right, low.y(), right + kWall_m, high.y());
  return house;
}

/// Against a wall of the room: along it, its back at the wall.
Solid againstWall(const Extent& room, const Eigen::Vector2d& size, double height_m, Random& random) {
  const int side = random.below(4);
  const double gap = random.between(0.0, 1.0) < 0.6 ? 0.0 : random.between(0.02, 0.06);
  Eigen::Vector2d low;
  const bool turned = side % 2 == 1;  // along y
  const Eigen::Vector2d extent = turned ? Eigen::Vector2d(size.y(), size.x()) : size;
  const Eigen::Vector2d free = room.size() - extent;
  low.x() = side == 3   ? room.low.x() + gap
            : side == 1 ? room.high.x() - extent.x() - gap
                        : room.low.x() + random.between(0.0, free.x());
  low.y() = side == 0   ? room.low.y() + gap
            : side == 2 ? room.high.y() - extent.y() - gap
                        : room.low.y() + random.between(0.0, free.y());
  return boxOf(low, low + extent, height_m, random.colour(0.05, 0.75));
}

Solid tallPiece(const Extent& room, Random& random) {
  switch (random.below(6)) {
    case 0:  // cupboard
      return againstWall(room, {random.between(0.7, 1.4), random.between(0.4, 0.6)}, random.between(1.6, 2.1),
                         random);
    case 1:  // shelf
      return againstWall(room, {random.between(0.6, 1.2), random.between(0.25, 0.4)},
                         random.between(0.9, 2.0), random);
    case 2:  // sofa
      return againstWall(room, {random.between(1.3, 2.0), random.between(0.7, 0.95)},
                         random.between(0.4, 0.85), random);
    case 3: {  // chest or table with closed sides, free-standing
      Solid solid;
      solid.size_m = {random.between(0.5, 1.0), random.between(0.4, 0.7)};
      solid.height_m = random.between(0.4, 0.8);
      solid.map_from_solid = {random.between(room.low.x() + 0.8, room.high.x() - 0.8),
                              random.between(room.low.y() + 0.8, room.high.y() - 0.8),
                              random.between(0.0, M_PI)};
      solid.albedo = random.colour(0.05, 0.75);
      return solid;
    }
    case 4: {  // pillar
      Solid solid;
      solid.round = true;
      solid.size_m = Eigen::Vector2d::Constant(random.between(0.2, 0.45));
      solid.height_m = kWallHeight_m;
      solid.map_from_solid = {random.between(room.low.x() + 0.4, room.high.x() - 0.4),
                              random.between(room.low.y() + 0.4, room.high.y() - 0.4), 0.0};
      solid.albedo = random.colour(0.1, 0.7);
      return solid;
    }
    default: {  // chair or waste bin
      Solid solid;
      solid.round = random.below(2) == 0;
      solid.size_m = {random.between(0.25, 0.45), random.between(0.25, 0.45)};
      if (solid.round) solid.size_m.y() = solid.size_m.x();
      solid.height_m = random.between(0.25, 0.9);
      solid.map_from_solid = {random.between(room.low.x() + 0.3, room.high.x() - 0.3),
                              random.between(room.low.y() + 0.3, room.high.y() - 0.3),
                              random.between(0.0, M_PI)};
      solid.albedo = random.colour(0.05, 0.75);
      return solid;
    }
  }
}

Solid lowPiece(const Extent& room, Random& random) {
  Solid solid;
  solid.round = random.between(0.0, 1.0) < 0.45;
  solid.size_m = {random.between(0.15, 0.45), random.between(0.15, 0.45)};
  if (solid.round) solid.size_m.y() = solid.size_m.x();
  solid.height_m = random.between(0.10, 0.30);
  solid.map_from_solid = {random.between(room.low.x() + 0.5, room.high.x() - 0.5),
                          random.between(room.low.y() + 0.5, room.high.y() - 0.5), random.between(0.0, M_PI)};
  solid.albedo = random.colour(0.05, 0.75);
  return solid;
}

/// 5 cm cells in which the robot's centre may be.
class FreeSpace {
 public:
  FreeSpace(const House& house, double clearance_m) {
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

  double share() const {
    return static_cast<double>(std::count(free_.begin(), free_.end(), 1)) / static_cast<double>(free_.size());
  }
  Eigen::Vector2d anywhere(Random& random) const {
    for (;;) {
      const int x = random.below(columns_), y = random.below(rows_);
      if (free_[index(x, y)] != 0) return middle(x, y);
    }
  }
  bool isFree(const Eigen::Vector2d& at) const {
    const int x = static_cast<int>((at.x() - low_.x()) / kCell_m),
              y = static_cast<int>((at.y() - low_.y()) / kCell_m);
    return x >= 0 && y >= 0 && x < columns_ && y < rows_ && free_[index(x, y)] != 0;
  }
  /// Straight line of sight between two places.
  bool isClear(const Eigen::Vector2d& a, const Eigen::Vector2d& b) const {
    const int steps = std::max(1, static_cast<int>((b - a).norm() / (0.5 * kCell_m)));
    for (int k = 0; k <= steps; ++k)
      if (!isFree(a + (b - a) * (static_cast<double>(k) / steps))) return false;
    return true;
  }
  /// Shortest path over the cells (Dijkstra), straightened; empty where there is none.
  std::vector<Eigen::Vector2d> path(const Eigen::Vector2d& from, const Eigen::Vector2d& to) const {
    const auto cell = [&](const Eigen::Vector2d& at) {
      return index(std::clamp(static_cast<int>((at.x() - low_.x()) / kCell_m), 0, columns_ - 1),
                   std::clamp(static_cast<int>((at.y() - low_.y()) / kCell_m), 0, rows_ - 1));
    };
    const std::size_t begin = cell(from), end = cell(to);
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
          if (u < 0 || v < 0 || u >= columns_ || v >= rows_ || free_[index(u, v)] == 0) continue;
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
    for (std::size_t at = end; at != begin; at = before[at])
      cells.push_back(middle(static_cast<int>(at) % columns_, static_cast<int>(at) / columns_));
    std::reverse(cells.begin(), cells.end());
    std::vector<Eigen::Vector2d> way;
    Eigen::Vector2d at = from;
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

 private:
  static constexpr double kCell_m = 0.05;
  std::size_t index(int x, int y) const { return static_cast<std::size_t>(y * columns_ + x); }
  Eigen::Vector2d middle(int x, int y) const { return low_ + kCell_m * Eigen::Vector2d(x + 0.5, y + 0.5); }
  /// Places that cannot be reached from the largest free area are not free.
  void keepLargest() {
    std::vector<int> area(free_.size(), -1);
    int areas = 0, best = -1;
    std::size_t most = 0;
    for (std::size_t seed = 0; seed < free_.size(); ++seed) {
      if (free_[seed] == 0 || area[seed] >= 0) continue;
      std::vector<std::size_t> stack{seed};
      std::size_t size = 0;
      area[seed] = areas;
      while (!stack.empty()) {
        const std::size_t at = stack.back();
        stack.pop_back();
        ++size;
        const int x = static_cast<int>(at) % columns_, y = static_cast<int>(at) / columns_;
        const int next[4][2] = {{x - 1, y}, {x + 1, y}, {x, y - 1}, {x, y + 1}};
        for (const auto& [u, v] : next) {
          if (u < 0 || v < 0 || u >= columns_ || v >= rows_) continue;
          if (free_[index(u, v)] == 0 || area[index(u, v)] >= 0) continue;
          area[index(u, v)] = areas;
          stack.push_back(index(u, v));
        }
      }
      if (size > most) most = size, best = areas;
      ++areas;
    }
    for (std::size_t at = 0; at < free_.size(); ++at) free_[at] = area[at] == best && best >= 0 ? 1 : 0;
  }

  Eigen::Vector2d low_;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint8_t> free_;
};

bool overlaps(const Solid& a, const Solid& b, double gap_m) {
  const auto corners = truthOf(a, 0).outline_m;
  const auto meets = [&](const Solid& solid, const Polygon& outline) {
    for (std::size_t i = 0; i < outline.size(); ++i) {
      for (int k = 0; k <= 8; ++k) {
        const Eigen::Vector2d at = outline[i] + (outline[(i + 1) % outline.size()] - outline[i]) * (k / 8.0);
        if (distanceTo(solid, at) < gap_m) return true;
      }
    }
    return false;
  };
  return meets(b, corners) || meets(a, truthOf(b, 0).outline_m) ||
         distanceTo(b, a.map_from_solid.translation()) <= 0.0;
}

void furnish(House& house, const FurnishedOptions& options, Random& random) {
  constexpr int kTries = 4000;
  constexpr double kLeastFree = 0.18;
  for (int tries = 0; tries < kTries && static_cast<int>(house.furniture.size()) < options.pieces; ++tries) {
    const Extent& room =
        house.rooms[static_cast<std::size_t>(random.below(static_cast<int>(house.rooms.size())))];
    const Solid piece =
        options.furniture == Furniture::kTall ? tallPiece(room, random) : lowPiece(room, random);
    const double gap = options.furniture == Furniture::kTall && random.below(4) == 0 ? 0.0 : 0.3;
    bool fits = true;
    for (const Solid& other : house.furniture) fits = fits && !overlaps(piece, other, std::max(0.005, gap));
    for (const Solid& wall : house.walls) fits = fits && !overlaps(piece, wall, -1e-3);
    if (!fits) continue;
    house.furniture.push_back(piece);
    const FreeSpace space(house, kClearance_m);
    bool reaches_all = space.share() > kLeastFree;
    for (const Extent& each : house.rooms) {  // each room keeps a place that can be reached
      bool any = false;
      for (double x = each.low.x() + 0.1; x < each.high.x() && !any; x += 0.1)
        for (double y = each.low.y() + 0.1; y < each.high.y() && !any; y += 0.1) any = space.isFree({x, y});
      reaches_all = reaches_all && any;
    }
    if (!reaches_all) house.furniture.pop_back();
  }
}

/// Drives towards a goal along its path: turns on the way, slower in bends. Waits for other robots.
class Driver {
 public:
  Driver(const FreeSpace& space, const Pose2& start) : space_(&space), pose(start) {}

  void drive(const std::vector<Eigen::Vector2d>& others, Random& random) {
    if (way_.empty()) way_ = space_->path(pose.translation(), space_->anywhere(random));
    while (!way_.empty() && (way_.front() - pose.translation()).norm() < 0.08) way_.erase(way_.begin());
    left_mps = right_mps = 0.0;
    if (way_.empty()) return;
    const Eigen::Vector2d to = pose.inverse() * way_.front();
    const double bearing = std::atan2(to.y(), to.x());
    const double turn = std::clamp(2.5 * bearing, -kTurn_radps, kTurn_radps);
    double speed = std::abs(bearing) > 0.6 ? 0.0 : kSpeed_mps * std::cos(bearing);
    speed = std::min(speed, 0.05 + 0.9 * to.norm());
    const Eigen::Vector2d next = pose * Eigen::Vector2d(speed > 0 ? 0.15 : 0.0, 0.0);
    for (const Eigen::Vector2d& other : others) {
      if ((next - other).norm() > kApart_m || speed <= 0.0) continue;
      speed = 0.0;
      if (++blocked_ > 100) way_.clear(), blocked_ = 0;
    }
    left_mps = speed - 0.5 * kSeparation_m * turn;
    right_mps = speed + 0.5 * kSeparation_m * turn;
    const double half = 0.5 * turn * kDrive_s,
                 chord = speed * kDrive_s * (std::abs(half) < 1e-9 ? 1.0 : std::sin(half) / half);
    pose = pose * Pose2{chord * std::cos(half), chord * std::sin(half), 2.0 * half};
    travelled_m += std::abs(chord);
  }

 private:
  const FreeSpace* space_;
  std::vector<Eigen::Vector2d> way_;
  int blocked_ = 0;

 public:
  Pose2 pose;
  double left_mps = 0.0, right_mps = 0.0, travelled_m = 0.0;
};

struct Frame {
  TimeNs time_ns;
  std::vector<Pose2> poses;  ///< of each robot
};

/// Mean wheel speeds (left, right) of each robot from a time on.
struct WheelStep {
  TimeNs time_ns;
  std::vector<Eigen::Vector2d> speed_mps;
};

struct Drive {
  std::vector<Frame> frames;
  std::vector<WheelStep> wheels;
};

Drive driveAll(const FurnishedOptions& options, const FreeSpace& space, Random& random) {
  std::vector<Driver> drivers;
  while (static_cast<int>(drivers.size()) < options.robots) {
    const Eigen::Vector2d at = space.anywhere(random);
    bool apart = true;
    for (const Driver& other : drivers)
      apart = apart && (other.pose.translation() - at).norm() > 2.0 * kApart_m;
    if (apart) drivers.emplace_back(space, Pose2{at.x(), at.y(), random.between(-M_PI, M_PI)});
  }
  Drive drive;
  double due_s = 0.0, due_m = 0.0;
  const bool by_distance = options.step_max_m > 0.0;
  for (int tick = 0; static_cast<int>(drive.frames.size()) < options.frames; ++tick) {
    const double now_s = tick * kDrive_s;
    const TimeNs now_ns = kBegin_ns + static_cast<TimeNs>(std::llround(1e9 * now_s));
    if (now_s > kLongest_s) throw std::runtime_error("raycast: the robots block each other");
    if (by_distance ? drivers[0].travelled_m >= due_m : now_s >= due_s - 1e-9) {
      Frame frame{now_ns, {}};
      for (const Driver& driver : drivers) frame.poses.push_back(driver.pose);
      drive.frames.push_back(frame);
      due_s += 1.0 / options.rate_hz;
      if (by_distance)
        due_m = drivers[0].travelled_m + random.between(options.step_min_m, options.step_max_m);
    }
    if (tick % kTicksPerRow == 0)
      drive.wheels.push_back({now_ns, std::vector<Eigen::Vector2d>(drivers.size(), Eigen::Vector2d::Zero())});
    for (std::size_t r = 0; r < drivers.size(); ++r) {
      std::vector<Eigen::Vector2d> others;
      for (std::size_t o = 0; o < drivers.size(); ++o)
        if (o != r) others.push_back(drivers[o].pose.translation());
      drivers[r].drive(others, random);
      drive.wheels.back().speed_mps[r] +=
          Eigen::Vector2d(drivers[r].left_mps, drivers[r].right_mps) / kTicksPerRow;
    }
  }
  return drive;
}

Room lit(const House& house, const FurnishedOptions& options, Random& random) {
  Room room;
  room.seed = options.seed;
  constexpr Floor kFloors[] = {Floor::kLino, Floor::kParquet, Floor::kCarpet, Floor::kConcrete};
  room.floor = kFloors[random.below(4)];
  const double level = random.between(0.25, 0.55);
  room.floor_albedo = level * Eigen::Vector3d(random.between(0.85, 1.15), random.between(0.9, 1.1),
                                              random.between(0.75, 1.1));
  for (const Extent& each : house.rooms) {
    const Eigen::Vector2d middle = 0.5 * (each.low + each.high);
    for (int k = 0; k < (options.dim ? 1 : 2); ++k)
      room.lamps.push_back(
          {{middle.x() + random.between(-1.0, 1.0), middle.y() + random.between(-0.8, 0.8), 2.3},
           random.between(0.6, 1.0)});
  }
  if (options.dim) room.ambient = 0.18, room.vignette = 0.25, room.light = 0.7;
  room.solids = house.walls;
  room.solids.insert(room.solids.end(), house.furniture.begin(), house.furniture.end());
  for (Solid& solid : room.solids) {
    // Nothing has the floor's colour; in a dim room contrast is low.
    const auto contrast = [&] {
      return (solid.albedo.cwiseQuotient(room.floor_albedo).array() - 1.0).abs().maxCoeff();
    };
    for (int tries = 0; contrast() < 0.35 && tries < 1000; ++tries) solid.albedo = random.colour(0.05, 0.75);
    if (options.dim)
      solid.albedo = room.floor_albedo.cwiseProduct(
          (solid.albedo.cwiseQuotient(room.floor_albedo).array().pow(0.45)).matrix());
    solid.chequered = random.between(0.0, 1.0) < 0.2;
  }
  return room;
}

lens::CameraModel cameraOf(const FurnishedOptions& options, Random& random) {
  lens::CameraModel camera;
  camera.projection = lens::Projection::kEquidistant;
  camera.image_width_px = options.width_px;
  camera.image_height_px = options.height_px;
  camera.fov_deg = 185.0;
  camera.position_m.z() = kCamera_m;
  const double focal = (0.5 * options.height_px - 2.0) / (camera.fov_deg * M_PI / 360.0);
  camera.focal_px = {focal, focal};
  camera.principal_point_px = {0.5 * (options.width_px - 1) + random.between(-3.0, 3.0),
                               0.5 * (options.height_px - 1) + random.between(-3.0, 3.0)};
  camera.self_mask_radius_px = std::ceil(focal * std::atan2(kRadius_m, kCamera_m - kHeight_m) + 4.0);
  return camera;
}

}  // namespace

void recordFurnished(const std::string& folder, const FurnishedOptions& options) {
  Random random(options.seed * 7919U + 17U);
  House house = walled(options, random);
  furnish(house, options, random);
  const FreeSpace space(house, kClearance_m);
  const Drive drive = driveAll(options, space, random);
  const std::vector<Frame>& frames = drive.frames;
  const Room room = lit(house, options, random);
  const lens::CameraModel camera = cameraOf(options, random);

  std::vector<dataset::RobotRecording> robots(static_cast<std::size_t>(options.robots));
  for (std::size_t r = 0; r < robots.size(); ++r) {
    robots[r].name = "r" + std::to_string(r + 1);
    const double away = options.start_error_m, turn = random.between(0.0, 2.0 * M_PI);
    robots[r].initial_pose =
        frames.front().poses[r] * Pose2{away * std::cos(turn), away * std::sin(turn),
                                        options.start_error_rad * (random.below(2) == 0 ? 1.0 : -1.0)};
    robots[r].body.radius_m = kRadius_m;
    robots[r].body.height_m = kHeight_m;
    robots[r].body.wheel_separation_m = kSeparation_m;
  }
  dataset::writeDatasetYaml(folder, robots);
  std::vector<dataset::MapObject> scene;
  for (const Solid& piece : house.furniture) scene.push_back(truthOf(piece, scene.size()));
  dataset::writeTruthScene(folder, scene);
  if (options.walls) dataset::writeTruthRoom(folder, house.inside);
  for (std::size_t r = 0; r < robots.size(); ++r) {
    lens::CameraModel calibrated = camera;  // with the errors of its calibration
    calibrated.focal_px *= 1.0 + options.focal_error;
    calibrated.rotation_rpy_deg.x() += options.tilt_error_deg;
    calibrated.rotation_rpy_deg.y() -= options.tilt_error_deg;
    dataset::ImageStreamWriter images(folder, robots[r].name + "/fisheye", calibrated);
    std::vector<dataset::StampedPose> truth;
    const Eigen::Vector2d scale(1.0 + random.normal(options.wheel_bias),
                                1.0 + random.normal(options.wheel_bias));
    for (std::size_t k = 0; k < frames.size(); ++k) {
      const Frame& frame = frames[k];
      truth.push_back({frame.time_ns, frame.poses[r]});
      std::vector<Solid> others;
      for (std::size_t o = 0; o < robots.size(); ++o) {
        others.push_back(
            {true,
             frame.poses[o],
             {2.0 * kRadius_m, 2.0 * kRadius_m},
             kHeight_m,
             o % 2 != 0 ? Eigen::Vector3d(0.10, 0.10, 0.12) : Eigen::Vector3d(0.60, 0.60, 0.62)});
      }
      const auto number = static_cast<unsigned>(k * robots.size() + r);
      images.write(frame.time_ns, render(room, camera, frame.poses[r], others, number));
    }
    if (options.wheels) {
      dataset::WheelsWriter wheels(folder, robots[r].name);
      for (const WheelStep& step : drive.wheels) {
        const Eigen::Vector2d measured = step.speed_mps[r].cwiseProduct(scale);
        wheels.write({step.time_ns, measured.x() * (1.0 + random.normal(0.02)),
                      measured.y() * (1.0 + random.normal(0.02))});
      }
    }
    dataset::writeTruthTrajectory(folder, robots[r].name, truth);
  }
}

}  // namespace omnifleet::raycast
