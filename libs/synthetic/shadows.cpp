#include "synthetic/shadows.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::synthetic {
namespace {

constexpr double kStepM = 0.01;  // step along the shadow
constexpr double kMinRimM = 0.004;

/// A robot as a solid: a cylinder, or the bounding box of its footprint.
Solid bodyOf(const RobotBody& body) {
  Solid solid;
  solid.height_m = body.height_m;
  if (body.radius_m > 0.0) {
    solid.kind = SolidKind::kCylinder;
    solid.radius_m = body.radius_m;
    return solid;
  }
  Eigen::Vector2d low = body.footprint_m.front(), high = low;
  for (const Eigen::Vector2d& p : body.footprint_m) low = low.cwiseMin(p), high = high.cwiseMax(p);
  solid.size_m = high - low;
  solid.map_from_solid = {0.5 * (low + high).x(), 0.5 * (low + high).y(), 0.0};
  return solid;
}

}  // namespace

Shadows::Shadows(const Arena& arena) : arena_(&arena) {
  if (any()) shadow_per_height_ = -arena.light.sun.head<2>() / arena.light.sun.z();
}

void Shadows::place(double time_s, const std::vector<Pose2>& map_from_bases) {
  casters_.clear();
  if (!any()) return;
  for (std::size_t i = 0; i < arena_->solids.size(); ++i)
    add(arena_->solids[i], arena_->solidAt(static_cast<int>(i), time_s));
  for (std::size_t i = 0; i < map_from_bases.size(); ++i) {
    const Solid body = bodyOf(arena_->robots[i].body);
    add(body, map_from_bases[i] * body.map_from_solid);
  }
}

void Shadows::add(const Solid& solid, const Pose2& map_from_solid) {
  const double reach_m = solid.kind == SolidKind::kBox ? 0.5 * solid.size_m.norm() : solid.radius_m;
  const Eigen::Vector2d way_m = solid.height_m * shadow_per_height_;
  const Eigen::Vector2d middle_m = map_from_solid.translation() + 0.5 * way_m;
  const double rim_m = kMinRimM + arena_->light.cast_softness * solid.height_m;
  casters_.push_back({solid, map_from_solid, middle_m.cast<float>(),
                      static_cast<float>(reach_m + 0.5 * way_m.norm() + rim_m)});
}

double Shadows::coverageOf(const Caster& caster, const Eigen::Vector2d& place_m) const {
  // The slice of the solid at height z shadows a position if that position, shifted back by the shadow of z,
  // is in the footprint. Shadows of higher slices are more blurred.
  const double height_m = caster.solid.height_m, way_m = height_m * shadow_per_height_.norm();
  const int steps = std::max(1, static_cast<int>(std::ceil(way_m / kStepM)));
  double coverage = 0.0;
  for (int i = 0; i <= steps; ++i) {
    const double z_m = height_m * i / steps;
    const double rim_m = kMinRimM + arena_->light.cast_softness * z_m;
    const double gap_m = caster.solid.distance(place_m - z_m * shadow_per_height_, caster.map_from_solid);
    coverage = std::max(coverage, std::clamp(0.5 - gap_m / rim_m, 0.0, 1.0));
  }
  return coverage;
}

float Shadows::at(const Eigen::Vector2f& place_m) const {
  double coverage = 0.0;
  for (const Caster& caster : casters_) {
    if ((place_m - caster.middle_m).squaredNorm() > caster.reach_m * caster.reach_m) continue;
    coverage = std::max(coverage, coverageOf(caster, place_m.cast<double>()));
  }
  return static_cast<float>(1.0 - arena_->light.cast_shadow * coverage);
}

}  // namespace omnifleet::synthetic
