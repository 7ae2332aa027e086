#include "tests/raycast/arena_layout.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace omnifleet::raycast {
namespace {

constexpr double kWallThick_m = 0.04, kBlockThick_m = 0.08;
constexpr double kPassage_m = 0.42;   // between solids that do not touch
constexpr double kPlanned_m = 0.15;   // clearance of base_link from everything
constexpr double kLeastShare = 0.34;  // of the arena that robots can reach

/// A straight wall of blocks from one point to another, in shares of half the arena's size.
struct BlockWall {
  Eigen::Vector2d from, to;
};

/// Figs. 5 and 6 in spirit: walls that divide the arena, with gaps at alternating sides.
std::vector<BlockWall> wallsOf(int layout) {
  if (layout == 1)
    return {{{-0.38, 1.0}, {-0.38, -0.12}}, {{0.30, -1.0}, {0.30, 0.05}}, {{0.333, 0.01}, {0.63, 0.01}}};
  if (layout == 2)
    return {{{-1.0, 0.08}, {-0.36, 0.08}}, {{0.34, 1.0}, {0.34, 0.26}}, {{0.02, -0.42}, {0.62, -0.42}}};
  throw std::runtime_error("raycast: the layout of the arena must be 1 or 2");
}

double linear(double grey) {
  const double share = grey / 255.0;
  return share <= 0.04045 ? share / 12.92 : std::pow((share + 0.055) / 1.055, 2.4);
}
Eigen::Vector3d albedoOf(const dataset::Rgb& rgb) {
  return {linear(rgb[0]), linear(rgb[1]), linear(rgb[2])};
}

Eigen::Vector3d paint(Random& random) {
  static const std::array<Eigen::Vector3d, 7> kPaints{
      Eigen::Vector3d(0.42, 0.10, 0.07), Eigen::Vector3d(0.07, 0.14, 0.38), Eigen::Vector3d(0.08, 0.28, 0.11),
      Eigen::Vector3d(0.50, 0.34, 0.06), Eigen::Vector3d(0.34, 0.19, 0.09), Eigen::Vector3d(0.05, 0.05, 0.06),
      Eigen::Vector3d(0.20, 0.08, 0.26)};
  const Eigen::Vector3d albedo = kPaints[static_cast<std::size_t>(random.below(kPaints.size()))];
  return albedo * random.between(0.85, 1.15);
}

Solid box(const Eigen::Vector2d& low, const Eigen::Vector2d& high, double height_m,
          const Eigen::Vector3d& albedo) {
  Solid solid;
  const Eigen::Vector2d middle = 0.5 * (low + high);
  solid.map_from_solid = {middle.x(), middle.y(), 0.0};
  solid.size_m = high - low;
  solid.height_m = height_m;
  solid.albedo = albedo;
  return solid;
}

void enclose(House& house, Random& random) {
  const Eigen::Vector2d half(random.between(1.42, 1.52), random.between(0.93, 1.0));
  house.rooms = {{-half, half}};
  house.inside = rectangleAt({}, -half, half);
  const Eigen::Vector3d albedo =
      random.below(2) == 0 ? Eigen::Vector3d(0.62, 0.60, 0.55) : Eigen::Vector3d(0.12, 0.20, 0.30);
  const double height_m = random.between(0.20, 0.25), t = kWallThick_m;
  const auto add = [&](double x0, double y0, double x1, double y1) {
    house.walls.push_back(box({x0, y0}, {x1, y1}, height_m, albedo));
  };
  add(-half.x() - t, -half.y() - t, half.x() + t, -half.y());
  add(-half.x() - t, half.y(), half.x() + t, half.y() + t);
  add(-half.x() - t, -half.y(), -half.x(), half.y());
  add(half.x(), -half.y(), half.x() + t, half.y());
}

/// Blocks of about 20 cm in a row, each with its own height and colour, a few millimetres apart.
void build(House& house, const BlockWall& wall, const Eigen::Vector2d& shift, Random& random) {
  const Eigen::Vector2d half = house.rooms.front().high, from = wall.from.cwiseProduct(half) + shift,
                        along = (wall.to - wall.from).cwiseProduct(half);
  const int blocks = std::max(1, static_cast<int>(std::round(along.norm() / 0.2)));
  const double pitch = along.norm() / blocks;
  for (int k = 0; k < blocks; ++k) {
    const Eigen::Vector2d middle =
        from + along * ((k + 0.5) / blocks) +
        Eigen::Vector2d(random.between(-0.002, 0.002), random.between(-0.002, 0.002));
    Solid block;
    block.map_from_solid = {middle.x(), middle.y(),
                            std::atan2(along.y(), along.x()) + random.between(-0.015, 0.015)};
    block.size_m = {pitch - 0.006, kBlockThick_m};
    block.height_m = random.between(0.15, 0.25);
    block.albedo = paint(random);
    house.furniture.push_back(block);
  }
}

Eigen::Vector2d anywhereIn(const Extent& room, double margin_m, Random& random) {
  return {random.between(room.low.x() + margin_m, room.high.x() - margin_m),
          random.between(room.low.y() + margin_m, room.high.y() - margin_m)};
}

double gapToAll(const House& house, const Polygon& outline) {
  double gap = std::numeric_limits<double>::infinity();
  for (const auto* list : {&house.walls, &house.furniture})
    for (const Solid& solid : *list) gap = std::min(gap, gapBetween(truthOf(solid, 0).outline_m, outline));
  return gap;
}

/// Free-standing blocks leave passages on all sides.
void addBlocks(House& house, int count, Random& random) {
  constexpr int kTries = 3000;
  int placed = 0;
  for (int tries = 0; tries < kTries && placed < count; ++tries) {
    Solid block;
    const Eigen::Vector2d at = anywhereIn(house.rooms.front(), 0.3, random);
    block.map_from_solid = {at.x(), at.y(), random.between(-M_PI, M_PI)};
    block.size_m = {random.between(0.08, 0.20), random.between(0.07, 0.12)};
    block.height_m = random.between(0.15, 0.25);
    block.albedo = paint(random);
    if (gapToAll(house, truthOf(block, 0).outline_m) < kPassage_m) continue;
    house.furniture.push_back(block);
    ++placed;
  }
}

/// A parked robot stands near a wall or block, out of the passages.
bool park(ArenaLayout& layout, Random& random) {
  constexpr int kTries = 3000;
  for (int tries = 0; tries < kTries; ++tries) {
    const Eigen::Vector2d at = anywhereIn(layout.house.rooms.front(), 0.1, random);
    const Pose2 pose{at.x(), at.y(), random.between(-M_PI, M_PI)};
    const double gap = gapToAll(withParked(layout), truthOf(bodyAt(pose), 0).outline_m);
    if (gap < 0.03 || gap > 0.12) continue;
    layout.parked.push_back(pose);
    return true;
  }
  return false;
}

/// Robots share colours: r1 and r3 have the same cover, the head of one is the tail of another.
dataset::MarkerSet markersOf(Random& random) {
  const dataset::Rgb red{225, 45, 40}, green{40, 190, 70}, blue{30, 80, 225}, yellow{240, 215, 40},
      magenta{215, 50, 190}, cyan{40, 200, 220};
  dataset::MarkerSet set;
  set.kind = dataset::MarkerKind::kCoverTailHead;
  set.height_m = kBodyHeight_m;
  set.cover_size_m = {0.136, 0.112};
  set.tail_offset_m = {-0.036, 0.0};
  set.tail_size_m = {0.036, 0.064};
  set.head_offset_m = {0.034, 0.0};
  set.head_size_m = {0.044, 0.044};
  std::array<dataset::RobotColours, kRobots> colours;
  colours[0] = {{}, yellow, red, blue};
  colours[1] = {{}, cyan, magenta, red};
  colours[2] = {{}, yellow, blue, red};
  colours[3] = {{}, green, red, magenta};
  const int turn = random.below(kRobots);
  for (int r = 0; r < kRobots; ++r)
    set.robots[arenaRobot(r)] = colours[static_cast<std::size_t>((r + turn) % kRobots)];
  return set;
}

/// One team patch and one individual patch per robot, on the same body.
dataset::MarkerSet patchesOf(Random& random) {
  const std::array<dataset::Rgb, kRobots> individual{
      dataset::Rgb{225, 45, 40}, {40, 190, 70}, {240, 215, 40}, {215, 50, 190}};
  dataset::MarkerSet set;
  set.height_m = kBodyHeight_m;
  set.team = {30, 80, 225};
  set.team_offset_m = {-0.031, 0.0};
  set.individual_offset_m = {0.047, 0.0};
  set.patch_size_m = {0.062, 0.096};
  const int turn = random.below(kRobots);
  for (int r = 0; r < kRobots; ++r)
    set.robots[arenaRobot(r)].individual = individual[static_cast<std::size_t>((r + turn) % kRobots)];
  return set;
}

/// Cards of the sizes and colours of markers on the floor.
void addCards(ArenaLayout& layout, int count, Random& random) {
  constexpr int kTries = 3000;
  for (int tries = 0; tries < kTries && static_cast<int>(layout.cards.size()) < count; ++tries) {
    const auto& colours = layout.markers.robots.at(arenaRobot(random.below(kRobots)));
    const int part = random.below(3);
    const Eigen::Vector2d at = anywhereIn(layout.house.rooms.front(), 0.1, random);
    FloorMarking card;
    card.map_from_marking = {at.x(), at.y(), random.between(-M_PI, M_PI)};
    if (layout.markers.kind == dataset::MarkerKind::kPatches) {
      card.size_m = layout.markers.patch_size_m;
      card.albedo = albedoOf(part == 0 ? layout.markers.team : colours.individual);
    } else {
      card.size_m = part == 0   ? layout.markers.cover_size_m
                    : part == 1 ? layout.markers.tail_size_m
                                : layout.markers.head_size_m;
      card.albedo = albedoOf(part == 0 ? colours.cover : part == 1 ? colours.tail : colours.head);
    }
    const Eigen::Vector2d half = 0.5 * card.size_m;
    if (gapToAll(withParked(layout), rectangleAt(card.map_from_marking, -half, half)) < 0.03) continue;
    layout.cards.push_back(card);
  }
}

}  // namespace

std::string arenaRobot(int index) {
  return "r" + std::to_string(index + 1);
}

RobotBody arenaBody() {
  RobotBody body;
  body.footprint_m = rectangleAt({}, kBody.low, kBody.high);
  body.height_m = kBodyHeight_m;
  return body;
}

Polygon rectangleAt(const Pose2& map_from_base, const Eigen::Vector2d& low, const Eigen::Vector2d& high) {
  return {map_from_base * low, map_from_base * Eigen::Vector2d(high.x(), low.y()), map_from_base * high,
          map_from_base * Eigen::Vector2d(low.x(), high.y())};
}

Solid bodyAt(const Pose2& map_from_base) {
  const Eigen::Vector2d middle = 0.5 * (kBody.low + kBody.high);
  Solid solid;
  solid.map_from_solid = map_from_base * Pose2{middle.x(), middle.y(), 0.0};
  solid.size_m = kBody.size();
  solid.height_m = kBodyHeight_m;
  solid.albedo = Eigen::Vector3d(0.045, 0.045, 0.05);
  return solid;
}

House withParked(const ArenaLayout& layout) {
  House house = layout.house;
  for (const Pose2& pose : layout.parked) house.furniture.push_back(bodyAt(pose));
  return house;
}

double gapBetween(const Polygon& a, const Polygon& b) {
  double separation = -std::numeric_limits<double>::infinity();  // of the best separating edge
  for (const auto* pair : {&a, &b}) {
    const Polygon& other = pair == &a ? b : a;
    for (std::size_t k = 0; k < pair->size(); ++k) {
      const Eigen::Vector2d edge = (*pair)[(k + 1) % pair->size()] - (*pair)[k],
                            outward = Eigen::Vector2d(edge.y(), -edge.x()).normalized();
      double least = std::numeric_limits<double>::infinity();
      for (const Eigen::Vector2d& corner : other) least = std::min(least, outward.dot(corner - (*pair)[k]));
      separation = std::max(separation, least);
    }
  }
  if (separation <= 0.0) return separation;
  double gap = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& corner : a) gap = std::min(gap, omnifleet::distanceTo(b, corner));
  for (const Eigen::Vector2d& corner : b) gap = std::min(gap, omnifleet::distanceTo(a, corner));
  return gap;
}

ArenaLayout arenaLayout(const ArenaOptions& options, Random& random) {
  constexpr int kTries = 200;
  for (int tries = 0; tries < kTries; ++tries) {
    ArenaLayout layout;
    enclose(layout.house, random);
    const Eigen::Vector2d mirror(random.below(2) == 0 ? 1.0 : -1.0, random.below(2) == 0 ? 1.0 : -1.0);
    for (const BlockWall& wall : wallsOf(options.layout)) {
      const Eigen::Vector2d along = (wall.to - wall.from).normalized();
      // Walls shift across their direction only, so that they stay joined to the outer walls.
      const Eigen::Vector2d shift = random.between(-0.04, 0.04) * Eigen::Vector2d(-along.y(), along.x());
      build(layout.house, {wall.from.cwiseProduct(mirror), wall.to.cwiseProduct(mirror)},
            options.layout == 1 ? Eigen::Vector2d::Zero() : shift, random);
    }
    addBlocks(layout.house, 2 + random.below(2), random);
    bool parked = true;
    while (parked && static_cast<int>(layout.parked.size()) < kRobots - kMapping)
      parked = park(layout, random);
    if (!parked || FreeSpace(withParked(layout), kPlanned_m).share() < kLeastShare) continue;
    layout.markers = options.patches ? patchesOf(random) : markersOf(random);
    addCards(layout, options.cards, random);
    return layout;
  }
  throw std::runtime_error("raycast: no accessible arena was found; choose another seed");
}

}  // namespace omnifleet::raycast
