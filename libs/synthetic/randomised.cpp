#include "synthetic/randomised.h"

#include <algorithm>
#include <cmath>
#include <random>

#include "synthetic/value_noise.h"

namespace omnifleet::synthetic {
namespace {

constexpr int kTries = 4000;
constexpr double kWallClearM = 0.25;

/// Uniform random numbers that are equal in every standard library.
class Dice {
 public:
  explicit Dice(std::uint32_t seed) : generator_(seed * 2654435761U + 97U) {}
  double in(double low, double high) { return low + (high - low) * (generator_() / 4294967295.0); }
  double in(const Eigen::Vector2d& range) { return in(range.x(), range.y()); }

 private:
  std::mt19937 generator_;
};

Rgb rgbOf(double r, double g, double b) {
  const auto level = [](double value) {
    return static_cast<std::uint8_t>(std::lround(std::clamp(value, 0.0, 255.0)));
  };
  return {level(r), level(g), level(b)};
}

/// Hue [0, 6), saturation, value [0, 1].
Rgb fromHsv(double hue, double saturation, double value) {
  const auto channel = [&](double shift) {
    const double k = std::fmod(shift + hue, 6.0);
    return 255.0 * value * (1.0 - saturation * std::clamp(std::min(k, 4.0 - k), 0.0, 1.0));
  };
  return rgbOf(channel(5), channel(3), channel(1));
}

double distanceToSegment(const Eigen::Vector2d& p, const Eigen::Vector2d& a, const Eigen::Vector2d& b) {
  const Eigen::Vector2d along = b - a;
  const double share = std::clamp((p - a).dot(along) / std::max(1e-12, along.squaredNorm()), 0.0, 1.0);
  return (p - a - share * along).norm();
}

std::vector<Eigen::Vector2d> waypointsOf(const Arena& arena) {
  std::vector<Eigen::Vector2d> waypoints;
  if (arena.has_formation) arena.formation.read("waypoints", waypoints);
  for (const ArenaRobot& robot : arena.robots) {
    waypoints.insert(waypoints.end(), robot.waypoints_m.begin(), robot.waypoints_m.end());
  }
  return waypoints;
}

/// Positions that must stay free for bodies: initial positions, waypoints, and the goals of the robots.
std::vector<Eigen::Vector2d> freePlaces(const Arena& arena) {
  std::vector<Eigen::Vector2d> places;
  for (const ArenaRobot& robot : arena.robots) places.push_back(robot.initial_map_from_base.translation());
  const std::vector<Eigen::Vector2d> waypoints = waypointsOf(arena);
  if (waypoints.empty()) return places;
  places.insert(places.end(), waypoints.begin(), waypoints.end());
  if (!arena.has_formation) return places;
  // Followers reach the goal in the formation of their initial poses, rotated into the direction of the
  // leader's last segment.
  const Pose2 initial = arena.robots.front().initial_map_from_base;
  const Eigen::Vector2d before_m =
      waypoints.size() > 1 ? waypoints[waypoints.size() - 2] : initial.translation();
  const Eigen::Vector2d way = waypoints.back() - before_m;
  const Pose2 goal{waypoints.back().x(), waypoints.back().y(), std::atan2(way.y(), way.x())};
  for (std::size_t i = 1; i < arena.robots.size(); ++i) {
    places.push_back(goal * (initial.inverse() * arena.robots[i].initial_map_from_base.translation()));
  }
  return places;
}

double reachOf(const Solid& solid) {
  return solid.kind == SolidKind::kBox ? 0.5 * solid.size_m.norm() : solid.radius_m;
}

double bodyReach(const Arena& arena) {
  double reach_m = 0.0;
  for (const ArenaRobot& robot : arena.robots) {
    reach_m = std::max(reach_m, robot.body.radius_m);
    for (const Eigen::Vector2d& vertex : robot.body.footprint_m) reach_m = std::max(reach_m, vertex.norm());
  }
  return reach_m;
}

class Planner {
 public:
  Planner(const Arena& arena, const Randomisation& options)
      : arena_(arena),
        options_(options),
        free_m_(freePlaces(arena)),
        way_m_(options.way),
        body_m_(bodyReach(arena)) {
    if (!way_m_.empty()) return;
    way_m_ = waypointsOf(arena);
    way_m_.insert(way_m_.begin(), arena.robots.front().initial_map_from_base.translation());
  }

  bool fits(const Solid& solid) const {
    const Eigen::Vector2d place_m = solid.map_from_solid.translation();
    const Eigen::Vector2d inside_m = 0.5 * arena_.floor.size_m - place_m.cwiseAbs();
    const double reach_m = reachOf(solid);
    if (inside_m.minCoeff() < reach_m + kWallClearM) return false;
    const bool walls =
        std::any_of(arena_.solids.begin(), arena_.solids.end(), [](const Solid& s) { return s.wall; });
    if (walls && inside_m.minCoeff() < reach_m + options_.passage_m) return false;
    for (const Solid& other : placed) {
      const double gap_m = (other.map_from_solid.translation() - place_m).norm() - reachOf(other) - reach_m;
      if (gap_m < options_.passage_m) return false;
    }
    for (const Solid& other : arena_.solids) {
      if (!other.fixed) continue;
      const Eigen::Vector2d other_m = other.map_from_solid.translation();
      if ((other_m - place_m).norm() - reachOf(other) - reach_m < options_.passage_m) return false;
    }
    if (onTour(place_m, reach_m)) return false;
    for (const Eigen::Vector2d& free_m : free_m_) {
      if (solid.distance(free_m, solid.map_from_solid) < body_m_ + options_.start_free_m) return false;
    }
    return toWay(place_m) <= options_.near_m;
  }

  std::vector<Solid> placed;

 private:
  /// True if a solid would narrow the tour of a robot.
  bool onTour(const Eigen::Vector2d& place_m, double reach_m) const {
    constexpr double kBeside_m = 0.05;  // a robot follows its tour within about 2 cm
    for (const ArenaRobot& robot : arena_.robots) {
      Eigen::Vector2d from_m = robot.initial_map_from_base.translation();
      for (std::size_t i = 0; i < 2 * robot.tour_m.size(); ++i) {  // twice: also from the end to the begin
        const Eigen::Vector2d& to_m = robot.tour_m[i % robot.tour_m.size()];
        if (distanceToSegment(place_m, from_m, to_m) < reach_m + body_m_ + kBeside_m) return true;
        from_m = to_m;
      }
    }
    return false;
  }
  double toWay(const Eigen::Vector2d& place_m) const {
    double least_m = INFINITY;
    for (const ArenaRobot& robot : arena_.robots) {
      least_m = std::min(least_m, (place_m - robot.initial_map_from_base.translation()).norm());
    }
    for (std::size_t i = 0; i + 1 < way_m_.size(); ++i) {
      least_m = std::min(least_m, distanceToSegment(place_m, way_m_[i], way_m_[i + 1]));
    }
    return least_m;
  }

  const Arena& arena_;
  const Randomisation& options_;
  std::vector<Eigen::Vector2d> free_m_, way_m_;
  double body_m_;
};

Solid randomSolid(const Arena& arena, const Randomisation& options, Dice& dice) {
  Solid solid;
  solid.kind = dice.in(0, 1) < 0.6 ? SolidKind::kBox : SolidKind::kCylinder;
  const Eigen::Vector2d half_m = 0.5 * arena.floor.size_m;
  solid.map_from_solid = {dice.in(-half_m.x(), half_m.x()), dice.in(-half_m.y(), half_m.y()),
                          dice.in(-M_PI, M_PI)};
  solid.size_m = {dice.in(options.size_m), dice.in(options.size_m)};
  solid.radius_m = 0.5 * dice.in(options.size_m);
  solid.height_m = dice.in(options.height_m);
  solid.texture = dice.in(0.05, 0.3);
  const bool dull = dice.in(0, 1) < options.dull_share;
  const double hue = dice.in(0, 6), value = dice.in(0.45, 0.9);
  solid.rgb =
      dull ? fromHsv(hue, dice.in(0.05, 0.2), dice.in(0.12, 0.3)) : fromHsv(hue, dice.in(0.65, 0.95), value);
  return solid;
}

void placeObstacles(const Randomisation& options, Dice& dice, Arena& arena) {
  Planner planner(arena, options);
  const int wanted =
      static_cast<int>(std::floor(dice.in(options.obstacles.x(), options.obstacles.y() + 1.0 - 1e-9)));
  for (int i = 0; i < kTries && static_cast<int>(planner.placed.size()) < wanted; ++i) {
    const Solid solid = randomSolid(arena, options, dice);
    if (planner.fits(solid)) planner.placed.push_back(solid);
  }
  if (static_cast<double>(planner.placed.size()) < options.obstacles.x()) {
    arena.random.fail(
        "obstacles",
        "not enough room for the minimum number; reduce obstacles, size_m, passage_m or start_free_m");
  }
  std::vector<Solid> lasting;  // fixed obstacles, then walls
  for (const bool wall : {false, true}) {
    std::copy_if(arena.solids.begin(), arena.solids.end(), std::back_inserter(lasting),
                 [&](const Solid& s) { return s.wall == wall && (s.wall || s.fixed); });
  }
  arena.solids = planner.placed;
  arena.solids.insert(arena.solids.end(), lasting.begin(), lasting.end());
  arena.moves.clear();
}

/// A colour similar to the floor: up to 20 % brighter or darker, with small changes per channel.
Rgb floorLike(const Rgb& floor, Dice& dice) {
  const double gain = dice.in(0.8, 1.2);
  return rgbOf(floor[0] * gain * dice.in(0.95, 1.05), floor[1] * gain * dice.in(0.95, 1.05),
               floor[2] * gain * dice.in(0.95, 1.05));
}

/// Properties that were added later. They use their own random numbers, so that the arenas of existing seeds
/// do not change.
void changeAddedProperties(const Randomisation& options, std::uint32_t seed, Arena& arena) {
  Dice dice(hash32(seed, 0x7113));
  arena.light.cast_shadow = std::max(arena.light.cast_shadow, dice.in(0.0, options.cast_shadow));
  if (options.tile_m.y() > 0.0) {
    arena.floor.grid_m = dice.in(options.tile_m);
    arena.floor.grid_width_m = dice.in(options.tile_line_m);
    const double gain = 1.0 + dice.in(-1.0, 0.5) * options.tile_line_contrast;
    const Rgb& rgb = arena.floor.rgb;
    arena.floor.grid_rgb = rgbOf(rgb[0] * gain, rgb[1] * gain, rgb[2] * gain);
    arena.floor.tile_variation = dice.in(0.0, options.tile_variation);
  }
  for (Solid& solid : arena.solids) {
    if (!solid.wall && dice.in(0, 1) < options.floor_like_share) solid.rgb = floorLike(arena.floor.rgb, dice);
  }
}

/// Colours and heights of obstacles that keep their places, and small shifts of them.
void changeFixed(const Randomisation& options, std::uint32_t seed, Arena& arena) {
  constexpr double kShift_m = 0.002, kTurn_rad = 0.01;
  Dice dice(hash32(seed, 0x2b1c));
  for (Solid& solid : arena.solids) {
    if (!solid.fixed) continue;
    const double hue = dice.in(0, 6), saturation = dice.in(0.5, 0.95), value = dice.in(0.25, 0.85);
    solid.rgb = fromHsv(hue, saturation, value);
    solid.height_m = dice.in(options.height_m);
    Pose2& pose = solid.map_from_solid;
    pose = {pose.x_m + dice.in(-kShift_m, kShift_m), pose.y_m + dice.in(-kShift_m, kShift_m),
            pose.theta_rad + dice.in(-kTurn_rad, kTurn_rad)};
  }
}

void changeAppearance(const Randomisation& options, Dice& dice, Arena& arena) {
  const double level = dice.in(options.floor_level), tint = options.floor_tint;
  arena.floor.rgb = rgbOf(level * (1 + dice.in(-tint, tint)), level * (1 + dice.in(-tint, tint)),
                          level * (1 + dice.in(-tint, tint)));
  arena.floor.clouds = dice.in(options.clouds);
  arena.floor.cloud_size_m = dice.in(0.3, 1.0);
  arena.floor.texture = dice.in(options.texture);
  arena.light.level = dice.in(options.light_level);
  const double angle_rad = dice.in(-M_PI, M_PI), gradient = dice.in(0.0, options.light_gradient_per_m);
  arena.light.gradient_per_m = gradient * Eigen::Vector2d(std::cos(angle_rad), std::sin(angle_rad));
  arena.light.spot = dice.in(-0.5 * options.light_spot, options.light_spot);
  arena.light.spot_m = {dice.in(-1.5, 1.5), dice.in(-1.0, 1.0)};
  arena.light.spot_size_m = dice.in(0.7, 1.6);
  arena.light.sun = {dice.in(-0.7, 0.7), dice.in(-0.7, 0.7), 1.0};
  arena.light.contact_shadow = dice.in(0.0, options.contact_shadow);
  arena.image.noise = dice.in(options.noise);
}

}  // namespace

Randomisation Randomisation::read(const options::Section& section) {
  Randomisation options;
  section.read("obstacles", options.obstacles, {0, 100});
  section.read("size_m", options.size_m, {0.03, 5.0});
  section.read("height_m", options.height_m, {0.02, 5.0});
  section.read("passage_m", options.passage_m, {0.0, 10.0});
  section.read("start_free_m", options.start_free_m, {0.0, 10.0});
  section.read("near_m", options.near_m, {0.1, 1000.0});
  section.read("way", options.way);
  section.read("start_jitter_m", options.start_jitter_m, {0.0, 5.0});
  section.read("start_jitter_rad", options.start_jitter_rad, {0.0, M_PI});
  section.read("floor_level", options.floor_level, {1, 255});
  section.read("floor_tint", options.floor_tint, {0.0, 0.9});
  section.read("clouds", options.clouds, {0.0, 0.5});
  section.read("texture", options.texture, {0.0, 0.5});
  section.read("light_level", options.light_level, {0.05, 3.0});
  section.read("light_gradient_per_m", options.light_gradient_per_m, {0.0, 1.0});
  section.read("light_spot", options.light_spot, {0.0, 1.0});
  section.read("contact_shadow", options.contact_shadow, {0.0, 1.0});
  section.read("cast_shadow", options.cast_shadow, {0.0, 1.0});
  section.read("tile_m", options.tile_m, {0.0, 10.0});
  section.read("tile_line_m", options.tile_line_m, {0.0005, 0.5});
  section.read("tile_line_contrast", options.tile_line_contrast, {0.0, 0.95});
  section.read("tile_variation", options.tile_variation, {0.0, 0.5});
  section.read("noise", options.noise, {0.0, 50.0});
  section.read("floor_like_share", options.floor_like_share, {0.0, 1.0});
  section.read("dull_share", options.dull_share, {0.0, 1.0});
  section.finish();
  return options;
}

Arena randomised(const Arena& arena, std::uint32_t seed) {
  const Randomisation options = Randomisation::read(arena.random);
  Dice dice(seed);
  Arena changed = arena;
  const double most_m = options.start_jitter_m, most_rad = options.start_jitter_rad;
  for (ArenaRobot& robot : changed.robots) {
    Pose2& initial = robot.initial_map_from_base;
    initial = {initial.x_m + dice.in(-most_m, most_m), initial.y_m + dice.in(-most_m, most_m),
               wrapAngle(initial.theta_rad + dice.in(-most_rad, most_rad))};
  }
  placeObstacles(options, dice, changed);
  changeAppearance(options, dice, changed);
  changeAddedProperties(options, seed, changed);
  changeFixed(options, seed, changed);
  return changed;
}

}  // namespace omnifleet::synthetic
