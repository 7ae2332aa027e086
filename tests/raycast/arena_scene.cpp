#include "tests/raycast/arena_scene.h"

#include <algorithm>
#include <cmath>

#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {
namespace {

constexpr double kContact_m = 0.03;  // reach of the dark rim at the foot of boxes

float linearOf(double grey) {
  const double share = grey / 255.0;
  return static_cast<float>(share <= 0.04045 ? share / 12.92 : std::pow((share + 0.055) / 1.055, 2.4));
}
Eigen::Vector3f albedoOf(const dataset::Rgb& rgb) {
  return {linearOf(rgb[0]), linearOf(rgb[1]), linearOf(rgb[2])};
}

ArenaBox boxOf(const Solid& solid, unsigned texture) {
  ArenaBox box;
  box.middle_m = solid.map_from_solid.translation();
  box.map_from_box = solid.map_from_solid.rotation();
  box.half_m = 0.5 * solid.size_m;
  box.height_m = solid.height_m;
  box.albedo = solid.albedo.cast<float>();
  box.texture = texture;
  return box;
}

double distanceTo(const ArenaBox& box, const Eigen::Vector2d& at) {
  const Eigen::Vector2d own = box.toBox(at);
  return (own.cwiseAbs() - box.half_m).cwiseMax(0.0).norm();
}

/// True if the line between two points meets the box.
bool blocks(const ArenaBox& box, const Eigen::Vector3d& from, const Eigen::Vector3d& to) {
  Eigen::Vector3d a, b;
  a << box.toBox(from.head<2>()), from.z();
  b << box.toBox(to.head<2>()), to.z();
  const Eigen::Vector3d low(-box.half_m.x(), -box.half_m.y(), 0.0),
      high(box.half_m.x(), box.half_m.y(), box.height_m);
  double enter = 0.0, leave = 1.0;
  for (int k = 0; k < 3; ++k) {
    const double along = b[k] - a[k];
    if (std::abs(along) < 1e-12) {
      if (a[k] < low[k] || a[k] > high[k]) return false;
      continue;
    }
    const double p = (low[k] - a[k]) / along, q = (high[k] - a[k]) / along;
    enter = std::max(enter, std::min(p, q));
    leave = std::min(leave, std::max(p, q));
  }
  return enter < leave;
}

/// Ambient light that a box takes from the floor beside it.
double contactShadow(const ArenaBox& box, const Eigen::Vector2d& at) {
  const double gap = distanceTo(box, at);
  return gap > 6.0 * kContact_m ? 1.0 : 1.0 - 0.4 * std::exp(-gap / kContact_m);
}

}  // namespace

ArenaScene::ArenaScene(const ArenaLayout& layout, const ArenaOptions& options)
    : room_(layout.house.rooms.front()),
      markers_(layout.markers),
      cards_(layout.cards),
      light_(options.light),
      glare_(options.glare),
      seed_(mixed(options.seed * 2654435761U + 5U)) {
  unsigned texture = seed_;
  for (const auto* list : {&layout.house.walls, &layout.house.furniture})
    for (const Solid& solid : *list) boxes_.push_back(boxOf(solid, ++texture));
  for (int r = 0; r < kRobots; ++r) {
    const dataset::RobotColours& colours = markers_.robots.at(arenaRobot(r));
    const Eigen::Vector3f body = Eigen::Vector3f::Constant(0.045F);
    if (markers_.kind == dataset::MarkerKind::kPatches)
      paints_[static_cast<std::size_t>(r)] = {body, albedoOf(markers_.team), albedoOf(colours.individual),
                                              body};
    else
      paints_[static_cast<std::size_t>(r)] = {body, albedoOf(colours.cover), albedoOf(colours.tail),
                                              albedoOf(colours.head)};
  }
  for (std::size_t k = 0; k < layout.parked.size(); ++k)
    boxes_.push_back(robotAt(kMapping + static_cast<int>(k), layout.parked[k]));
  Random random(seed_);
  floor_albedo_ =
      random.below(2) == 0 ? Eigen::Vector3f(0.40F, 0.37F, 0.32F) : Eigen::Vector3f(0.30F, 0.32F, 0.33F);
  ambient_ = 1.0 - options.direct;
  const std::array<double, kLamps> share{0.65, 0.35};
  for (std::size_t k = 0; k < lamps_.size(); ++k) {
    const double side = k == 0 ? 1.0 : -1.0;
    lamps_[k].at_m = {side * random.between(0.3, 1.6), random.between(-1.3, 1.3), random.between(2.6, 3.0)};
    const Eigen::Vector3d& at = lamps_[k].at_m;
    lamps_[k].power =
        options.direct * share[k] * std::pow(at.norm(), 3.0) / at.z();  // full light at the origin
  }
  paintFloor();
  lightFloor();
}

ArenaBox ArenaScene::robotAt(int robot, const Pose2& map_from_base) const {
  ArenaBox box = boxOf(bodyAt(map_from_base), seed_ + 1000U + static_cast<unsigned>(robot));
  box.robot = robot;
  return box;
}

int ArenaScene::paintAt(const ArenaBox& box, const Eigen::Vector2d& in_box) const {
  const Eigen::Vector2d in_base = in_box + 0.5 * (kBody.low + kBody.high);
  const auto covers = [&](const Eigen::Vector2d& middle, const Eigen::Vector2d& size) {
    return box.robot >= 0 && (2.0 * (in_base - middle).cwiseAbs() - size).maxCoeff() < 0.0;
  };
  if (markers_.kind == dataset::MarkerKind::kPatches) {
    if (covers(markers_.individual_offset_m, markers_.patch_size_m)) return 2;
    return covers(markers_.team_offset_m, markers_.patch_size_m) ? 1 : 0;
  }
  if (covers(markers_.head_offset_m, markers_.head_size_m)) return 3;
  if (covers(markers_.tail_offset_m, markers_.tail_size_m)) return 2;
  return covers({0.0, 0.0}, markers_.cover_size_m) ? 1 : 0;
}

int ArenaScene::cardAt(const Eigen::Vector2d& at) const {
  for (std::size_t k = cards_.size(); k-- > 0;) {
    const Eigen::Vector2d off = at - cards_[k].map_from_marking.translation();
    if (off.squaredNorm() > 0.25 * cards_[k].size_m.squaredNorm()) continue;
    const Eigen::Vector2d own = cards_[k].map_from_marking.inverse() * at;
    if ((2.0 * own.cwiseAbs() - cards_[k].size_m).maxCoeff() < 0.0) return static_cast<int>(k) + 1;
  }
  return 0;
}

ArenaScene::FloorMap ArenaScene::emptyMap(double cell_m) const {
  FloorMap map;
  map.low = room_.low - Eigen::Vector2d::Constant(kOutside_m);
  map.cell_m = cell_m;
  const Eigen::Vector2d size = room_.size() + Eigen::Vector2d::Constant(2.0 * kOutside_m);
  map.columns = static_cast<int>(std::ceil(size.x() / cell_m)) + 1;
  map.rows = static_cast<int>(std::ceil(size.y() / cell_m)) + 1;
  map.cells.resize(static_cast<std::size_t>(map.columns * map.rows));
  return map;
}

Eigen::Vector3f ArenaScene::FloorMap::at(const Eigen::Vector2d& place) const {
  const Eigen::Vector2d cell = (place - low) / cell_m;
  const double x = std::clamp(cell.x(), 0.0, columns - 1.001), y = std::clamp(cell.y(), 0.0, rows - 1.001);
  const int i = static_cast<int>(x), j = static_cast<int>(y);
  const auto u = static_cast<float>(x - i), v = static_cast<float>(y - j);
  const Eigen::Vector3f* row = &cells[static_cast<std::size_t>(j * columns + i)];
  return (1 - v) * ((1 - u) * row[0] + u * row[1]) + v * ((1 - u) * row[columns] + u * row[columns + 1]);
}

/// A board with speckles, faint clouds and scratches.
void ArenaScene::paintFloor() {
  albedo_ = emptyMap(kTexel_m);
  for (int y = 0; y < albedo_.rows; ++y) {
    for (int x = 0; x < albedo_.columns; ++x) {
      const Eigen::Vector2d at = albedo_.middle(x, y);
      const double clouds = 0.10 * (smoothAt(5 * at.x(), 5 * at.y(), seed_) - 0.5),
                   speckles = 0.10 * (smoothAt(160 * at.x(), 160 * at.y(), seed_ + 1) - 0.5),
                   scratches = 0.06 * (smoothAt(12 * at.x(), 120 * at.y(), seed_ + 2) - 0.5);
      albedo_.cells[static_cast<std::size_t>(y * albedo_.columns + x)] =
          static_cast<float>(1.0 + clouds + speckles + scratches) * floor_albedo_;
    }
  }
}

void ArenaScene::lightFloor() {
  irradiance_ = emptyMap(kLumel_m);
  for (int y = 0; y < irradiance_.rows; ++y) {
    for (int x = 0; x < irradiance_.columns; ++x) {
      const Eigen::Vector2d at = irradiance_.middle(x, y);
      Eigen::Vector3f& cell = irradiance_.cells[static_cast<std::size_t>(y * irradiance_.columns + x)];
      double ambient = ambient_;
      for (const ArenaBox& box : boxes_) ambient *= contactShadow(box, at);
      cell[0] = static_cast<float>(ambient);
      for (int k = 0; k < kLamps; ++k) {
        const Lamp& lamp = lamps_[static_cast<std::size_t>(k)];
        const Eigen::Vector3d to = lamp.at_m - Eigen::Vector3d(at.x(), at.y(), 0.0);
        cell[k + 1] = static_cast<float>(lamp.power * to.z() / std::pow(to.norm(), 3.0)) *
                      visibility(lamp, at, boxes_.data(), boxes_.size());
      }
    }
  }
}

/// Share of the lamp's disc that boxes leave visible.
float ArenaScene::visibility(const Lamp& lamp, const Eigen::Vector2d& at, const ArenaBox* boxes,
                             std::size_t count) {
  constexpr int kPoints = 9;
  constexpr double kGolden_rad = 2.399963;
  const Eigen::Vector2d to = lamp.at_m.head<2>() - at;
  std::array<bool, kPoints> hidden{};
  for (std::size_t b = 0; b < count; ++b) {
    const ArenaBox& box = boxes[b];
    // While the ray to the lamp is lower than the box, it stays within `near_m` of `middle`.
    const double share = 0.5 * box.height_m / lamp.at_m.z(),
                 near_m = share * (to.norm() + 2.0 * lamp.radius_m);
    const Eigen::Vector2d middle = at + share * to;
    if ((box.toBox(middle).cwiseAbs() - box.half_m).maxCoeff() > near_m) continue;
    for (int k = 0; k < kPoints; ++k) {
      const double radius = lamp.radius_m * std::sqrt((k + 0.5) / kPoints), angle = kGolden_rad * k;
      const Eigen::Vector3d from(at.x(), at.y(), 1e-4),
          end = lamp.at_m + radius * Eigen::Vector3d(std::cos(angle), std::sin(angle), 0.0);
      auto& is_hidden = hidden[static_cast<std::size_t>(k)];
      is_hidden = is_hidden || blocks(box, from, end);
    }
  }
  return static_cast<float>(std::count(hidden.begin(), hidden.end(), false)) / kPoints;
}

Eigen::Vector3f ArenaScene::floorAt(const Eigen::Vector2d& at, int card, const Eigen::Vector3f& along,
                                    const std::vector<ArenaBox>& moving) const {
  Eigen::Vector3f light = irradiance_.at(at);
  for (const ArenaBox& robot : moving) {
    const double reach = kShadow_m + robot.half_m.norm();
    if ((at - robot.middle_m).squaredNorm() > reach * reach) continue;
    light[0] *= static_cast<float>(contactShadow(robot, at));
    for (int k = 0; k < kLamps; ++k)
      if (light[k + 1] > 0.0F) light[k + 1] *= visibility(lamps_[static_cast<std::size_t>(k)], at, &robot, 1);
  }
  Eigen::Vector3f albedo = floor_albedo_ * 0.5F;  // outside of the arena
  const Eigen::Vector2d beyond = (at - 0.5 * (room_.low + room_.high)).cwiseAbs() - 0.5 * room_.size();
  if (card > 0)
    albedo = cards_[static_cast<std::size_t>(card - 1)].albedo.cast<float>();
  else if (beyond.maxCoeff() < 0.0)
    albedo = albedo_.at(at);
  Eigen::Vector3f radiance = light.sum() * albedo;
  if (glare_ > 0.0) {
    constexpr float kSharpness = 60.0F;
    const Eigen::Vector3f mirrored(along.x(), along.y(), -along.z());
    for (int k = 0; k < kLamps; ++k) {
      const Eigen::Vector3d to =
          lamps_[static_cast<std::size_t>(k)].at_m - Eigen::Vector3d(at.x(), at.y(), 0.0);
      const float cosine = mirrored.dot(to.normalized().cast<float>());
      if (cosine > 0.8F)
        radiance.array() += static_cast<float>(glare_) * light[k + 1] * std::pow(cosine, kSharpness);
    }
  }
  return radiance;
}

Eigen::Vector3f ArenaScene::boxAt(const ArenaBox& box, Surface3::Face face, int paint,
                                  const Eigen::Vector3d& in_box) const {
  Eigen::Vector3f albedo = box.albedo;
  double u = in_box.x(), v = in_box.y();  // on the face
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  if (face != Surface3::kTop) {
    const bool along_x = face == Surface3::kBack || face == Surface3::kFront;
    const double sign = face == Surface3::kBack || face == Surface3::kRight ? -1.0 : 1.0;
    const Eigen::Vector2d turned =
        box.map_from_box * (along_x ? Eigen::Vector2d(sign, 0.0) : Eigen::Vector2d(0.0, sign));
    normal << turned, 0.0;
    u = along_x ? in_box.y() : in_box.x();
    v = in_box.z();
  }
  if (paint > 0)
    albedo = paints_[static_cast<std::size_t>(box.robot)][static_cast<std::size_t>(paint)];
  else
    albedo *= static_cast<float>(1.0 + 0.14 * (smoothAt(20 * u, 130 * v, box.texture) - 0.5) +
                                 0.10 * (smoothAt(60 * u, 60 * v, box.texture + 7U) - 0.5));
  Eigen::Vector3d at;
  at << box.toMap(in_box.head<2>()), in_box.z();
  double light = ambient_ * (0.65 + 0.35 * normal.z());
  if (face != Surface3::kTop) light *= 1.0 - 0.3 * std::exp(-in_box.z() / kContact_m);
  for (const Lamp& lamp : lamps_) {
    const Eigen::Vector3d to = lamp.at_m - at;
    light += lamp.power * std::max(0.0, to.dot(normal)) / (to.squaredNorm() * to.norm());
  }
  return static_cast<float>(light) * albedo;
}

/// The room around the arena, out of focus.
Eigen::Vector3f ArenaScene::skyAlong(const Eigen::Vector3f& along) const {
  const double x = along.x(), y = along.y(), z = along.z();
  const double grey = 0.12 + 0.35 * smoothAt(4.0 * x + 3.0 * z + 20.0, 4.0 * y - 3.0 * z + 20.0, seed_ + 11U);
  const double hue = 0.2 * (smoothAt(2.0 * x + z + 20.0, 2.0 * y - z + 20.0, seed_ + 12U) - 0.5);
  return static_cast<float>(grey) *
         Eigen::Vector3f(static_cast<float>(1.0 + hue), 1.0F, static_cast<float>(1.0 - hue));
}

}  // namespace omnifleet::raycast
