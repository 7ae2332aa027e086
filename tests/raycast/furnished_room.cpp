#include "tests/raycast/furnished_room.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "tests/raycast/free_space.h"
#include "tests/raycast/room_decoration.h"
#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {
namespace {

constexpr double kWallHeight_m = 2.4, kWall_m = 0.1, kDoor_m = 0.95;
constexpr double kMirror_m = 1.4, kMirrorHeight_m = 2.0, kGlass_m = 1.6;  // widths and height

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

/// Walls around one or two rooms side by side; between two a door.
House walled(const FurnishedOptions& options, Random& random) {
  House house;
  const double width = random.between(options.width_min_m, options.width_max_m),
               depth = random.between(options.depth_min_m, options.depth_max_m);
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
  if (!options.glass) {
    wall(right, low.y(), right + kWall_m, high.y());
    return house;
  }
  const double edge = 0.5 * kGlass_m;
  wall(right, low.y(), right + kWall_m, -edge);
  wall(right, edge, right + kWall_m, high.y());
  wall(right, -edge, right + 0.02, edge);
  house.walls.back().surface = Surface::kGlass;
  return house;
}

/// In the middle of the left wall, 1 cm thick.
void addMirror(House& house) {
  const double left = house.rooms.front().low.x(), edge = 0.5 * kMirror_m;
  house.walls.push_back(
      boxOf({left, -edge}, {left + 0.01, edge}, kMirrorHeight_m, Eigen::Vector3d::Constant(0.5)));
  house.walls.back().surface = Surface::kMirror;
}

/// Furniture does not stand in front of a mirror or of glass.
bool hidesReflections(const Solid& piece, const House& house) {
  return std::any_of(house.walls.begin(), house.walls.end(), [&](const Solid& wall) {
    return wall.surface != Surface::kMatt && distanceTo(wall, piece.map_from_solid.translation()) < 1.0;
  });
}

bool blocksDoor(const Solid& piece, const House& house) {
  constexpr double kFree_m = 0.8;
  return std::any_of(house.doors.begin(), house.doors.end(),
                     [&](const Eigen::Vector2d& door) { return distanceTo(piece, door) < kFree_m; });
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

/// The largest free area reaches into each room.
bool reachesAllRooms(const House& house) {
  constexpr double kLeastFree = 0.18;
  const FreeSpace space(house, kClearance_m);
  bool reaches_all = space.share() > kLeastFree;
  for (const Extent& each : house.rooms) {
    bool any = false;
    for (double x = each.low.x() + 0.1; x < each.high.x() && !any; x += 0.1)
      for (double y = each.low.y() + 0.1; y < each.high.y() && !any; y += 0.1) any = space.isFree({x, y});
    reaches_all = reaches_all && any;
  }
  return reaches_all;
}

void furnish(House& house, const FurnishedOptions& options, Random& random) {
  constexpr int kTries = 4000;
  const std::size_t at_once = options.symmetric ? 2 : 1, pieces = static_cast<std::size_t>(options.pieces);
  for (int tries = 0; tries < kTries && house.furniture.size() + at_once <= pieces; ++tries) {
    const Extent& room =
        house.rooms[static_cast<std::size_t>(random.below(static_cast<int>(house.rooms.size())))];
    const Solid piece =
        options.furniture == Furniture::kTall ? tallPiece(room, random) : lowPiece(room, random);
    const double gap = options.furniture == Furniture::kTall && random.below(4) == 0 ? 0.0 : 0.3;
    bool fits = !options.symmetric || !overlaps(piece, turnedAround(piece), std::max(0.005, gap));
    for (const Solid& other : house.furniture) fits = fits && !overlaps(piece, other, std::max(0.005, gap));
    for (const Solid& wall : house.walls) fits = fits && !overlaps(piece, wall, -1e-3);
    fits = fits && !hidesReflections(piece, house) && !blocksDoor(piece, house);
    if (!fits) continue;
    house.furniture.push_back(piece);
    if (options.symmetric) house.furniture.push_back(turnedAround(piece));
    if (!reachesAllRooms(house)) house.furniture.resize(house.furniture.size() - at_once);
  }
  if (options.decorated) decorateFurniture(house, random);
}

std::vector<Lamp> lampsOf(const House& house, const FurnishedOptions& options, Random& random) {
  std::vector<Lamp> lamps;
  for (const Extent& each : house.rooms) {
    const Eigen::Vector2d middle = 0.5 * (each.low + each.high);
    for (int k = 0; k < (options.dim ? 1 : 2); ++k)
      lamps.push_back({{middle.x() + random.between(-1.0, 1.0), middle.y() + random.between(-0.8, 0.8), 2.3},
                       random.between(0.6, 1.0)});
  }
  if (!options.symmetric) return lamps;
  if (options.dim) lamps.front().at_m.head<2>().setZero();
  if (!options.dim) lamps.back() = lamps.front();
  if (!options.dim) lamps.back().at_m.head<2>() *= -1.0;
  return lamps;
}

/// In a dim room contrast to the floor is low.
Eigen::Vector3d dimmed(const Eigen::Vector3d& albedo, const Eigen::Vector3d& floor) {
  return floor.cwiseProduct((albedo.cwiseQuotient(floor).array().pow(0.45)).matrix());
}

/// Nothing has the floor's colour.
void colour(Solid& solid, const Eigen::Vector3d& floor, bool dim, Random& random) {
  const auto contrast = [&] { return (solid.albedo.cwiseQuotient(floor).array() - 1.0).abs().maxCoeff(); };
  for (int tries = 0; contrast() < 0.35 && tries < 1000; ++tries) solid.albedo = random.colour(0.05, 0.75);
  if (dim) solid.albedo = dimmed(solid.albedo, floor);
  solid.chequered = random.between(0.0, 1.0) < 0.2;
  if (!solid.panels.empty() || solid.front != Front::kPlain) solid.chequered = false;
  for (Panel& panel : solid.panels) {
    while ((panel.albedo.cwiseQuotient(floor).array() - 1.0).abs().maxCoeff() < 0.35) panel.albedo *= 0.8;
    if (dim) panel.albedo = dimmed(panel.albedo, floor);
  }
}

}  // namespace

double distanceTo(const Solid& solid, const Eigen::Vector2d& at) {
  const Eigen::Vector2d own = solid.map_from_solid.inverse() * at;
  if (solid.round) return own.norm() - 0.5 * solid.size_m.x();
  return (own.cwiseAbs() - 0.5 * solid.size_m).cwiseMax(0.0).norm();
}

double rangeTo(const Solid& solid, const Eigen::Vector2d& from, const Eigen::Vector2d& along) {
  constexpr double kNone = std::numeric_limits<double>::infinity();
  const Pose2 solid_from_map = solid.map_from_solid.inverse();
  const Eigen::Vector2d own = solid_from_map * from, ahead = solid_from_map.rotation() * along;
  if (solid.round) {
    const double nearest = -own.dot(ahead), radius = 0.5 * solid.size_m.x();
    const double half2 = radius * radius - (own + nearest * ahead).squaredNorm();
    return half2 >= 0.0 && nearest >= 0.0 ? std::max(0.0, nearest - std::sqrt(half2)) : kNone;
  }
  double enter = 0.0, leave = kNone;
  for (int k = 0; k < 2; ++k) {
    const double half = 0.5 * solid.size_m[k];
    if (std::abs(ahead[k]) < 1e-12) {
      if (std::abs(own[k]) > half) return kNone;
      continue;
    }
    const double a = (-half - own[k]) / ahead[k], b = (half - own[k]) / ahead[k];
    enter = std::max(enter, std::min(a, b));
    leave = std::min(leave, std::max(a, b));
  }
  return enter < leave ? enter : kNone;
}

Solid turnedAround(Solid solid) {
  solid.map_from_solid = Pose2{0.0, 0.0, M_PI} * solid.map_from_solid;
  return solid;
}

House furnishedHouse(const FurnishedOptions& options, Random& random) {
  House house = walled(options, random);
  if (options.mirror) addMirror(house);
  if (options.decorated) decorateWalls(house, random);
  furnish(house, options, random);
  return house;
}

House refurnished(House house, const FurnishedOptions& options, Random& random) {
  house.furniture.clear();
  furnish(house, options, random);
  return house;
}

Room litRoom(const House& house, const FurnishedOptions& options, Random& random) {
  Room room;
  room.seed = options.seed;
  constexpr Floor kFloors[] = {Floor::kLino, Floor::kParquet, Floor::kCarpet, Floor::kConcrete};
  room.floor = kFloors[random.below(4)];
  if (options.symmetric) room.floor = Floor::kPlain;
  const double level = random.between(0.25, 0.55);
  room.floor_albedo = level * Eigen::Vector3d(random.between(0.85, 1.15), random.between(0.9, 1.1),
                                              random.between(0.75, 1.1));
  room.lamps = lampsOf(house, options, random);
  if (options.dim) room.ambient = 0.18, room.vignette = 0.25, room.light = 0.7;
  room.solids = house.walls;
  room.solids.insert(room.solids.end(), house.furniture.begin(), house.furniture.end());
  for (std::size_t k = 0; k < room.solids.size(); ++k) {
    colour(room.solids[k], room.floor_albedo, options.dim, random);
    if (options.symmetric) room.solids[k].chequered = false;  // squares are fixed to the map
    if (options.symmetric && k % 2 == 1) room.solids[k].albedo = room.solids[k - 1].albedo;
  }
  return room;
}

Room refurnished(Room room, const House& house, const FurnishedOptions& options, Random& random) {
  room.seed = mixed(room.seed + 1U);
  room.solids.resize(house.walls.size());
  for (const Solid& piece : house.furniture) {
    room.solids.push_back(piece);
    colour(room.solids.back(), room.floor_albedo, options.dim, random);
  }
  return room;
}

}  // namespace omnifleet::raycast
