#include "tests/raycast/ray_scene.h"

#include <algorithm>
#include <cmath>

#include "tests/raycast/surface_albedo.h"
#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {
namespace {

using Vector = Eigen::Vector3d;

constexpr double kFarthest_m = 20.0;  // farther floor is rendered as haze
constexpr double kNone = std::numeric_limits<double>::infinity();

/// Intersects a ray with the solid, both in the frame of the solid. Updates `best` if the hit is nearer.
void intersectBox(const Solid& solid, const Vector& from, const Vector& along, Hit& best) {
  const Vector low(-0.5 * solid.size_m.x(), -0.5 * solid.size_m.y(), 0.0),
      high(0.5 * solid.size_m.x(), 0.5 * solid.size_m.y(), solid.height_m);
  double enter = 1e-6, leave = best.range_m;
  int axis = -1;
  for (int k = 0; k < 3; ++k) {
    if (std::abs(along[k]) < 1e-12) {
      if (from[k] < low[k] || from[k] > high[k]) return;
      continue;
    }
    const double a = (low[k] - from[k]) / along[k], b = (high[k] - from[k]) / along[k];
    if (std::min(a, b) > enter) {
      enter = std::min(a, b);
      axis = k;
    }
    leave = std::min(leave, std::max(a, b));
  }
  if (axis < 0 || enter >= leave) return;
  Vector normal = Vector::Zero();
  normal[axis] = along[axis] > 0 ? -1.0 : 1.0;
  best = {enter, normal, &solid, nullptr};
}

void intersectCylinder(const Solid& solid, const Vector& from, const Vector& along, Hit& best) {
  const double radius = 0.5 * solid.size_m.x(), a = along.head<2>().squaredNorm(),
               b = from.head<2>().dot(along.head<2>()),
               discriminant = b * b - a * (from.head<2>().squaredNorm() - radius * radius);
  const auto isNearer = [&](double range) { return range > 1e-6 && range < best.range_m; };
  if (discriminant > 0 && a > 1e-12) {
    const double range = (-b - std::sqrt(discriminant)) / a;
    const Vector at = from + range * along;
    if (isNearer(range) && at.z() >= 0 && at.z() <= solid.height_m)
      best = {range, Vector(at.x() / radius, at.y() / radius, 0.0), &solid, nullptr};
  }
  if (along.z() >= 0) return;
  const double range = (solid.height_m - from.z()) / along.z();
  const Vector at = from + range * along;
  if (isNearer(range) && at.head<2>().norm() < radius) best = {range, Vector::UnitZ(), &solid, nullptr};
}

void intersect(const Placed& placed, const Vector& from, const Vector& along, Hit& best) {
  if (!placed.mayMeet(from, along)) return;
  const Solid& solid = *placed.solid;
  Vector own_from = from, own_along = along;
  own_from.head<2>() = placed.rotation * from.head<2>() + placed.translation;
  own_along.head<2>() = placed.rotation * along.head<2>();
  const double before = best.range_m;
  if (solid.round)
    intersectCylinder(solid, own_from, own_along, best);
  else
    intersectBox(solid, own_from, own_along, best);
  if (best.range_m < before) {
    best.placed = &placed;
    const Eigen::Vector2d turned = placed.rotation.transpose() * best.normal.head<2>();
    best.normal.head<2>() = turned;
  }
}

Vector albedoOf(const Room& room, const Hit& hit, const Vector& at) {
  Vector own = at, own_normal = hit.normal;
  own.head<2>() = hit.placed->rotation * at.head<2>() + hit.placed->translation;
  own_normal.head<2>() = hit.placed->rotation * hit.normal.head<2>();
  return solidAlbedo(room, *hit.solid, at, own, own_normal);
}

/// True if a solid lies between the two points. Solids far from the line are skipped early.
bool isHidden(const std::vector<Placed>& solids, const Vector& from, const Vector& to) {
  const Vector along = to - from;
  const Eigen::Vector2d line = along.head<2>();
  return std::any_of(solids.begin(), solids.end(), [&](const Placed& solid) {
    const Eigen::Vector2d beside = solid.middle_m - from.head<2>();
    const double share = std::clamp(beside.dot(line) / std::max(1e-12, line.squaredNorm()), 0.0, 1.0);
    if ((beside - share * line).norm() > 0.5 * solid.solid->size_m.norm()) return false;
    Hit hit;
    hit.range_m = 1.0;
    intersect(solid, from, along, hit);
    return hit.solid != nullptr;
  });
}

/// A random point of the lamp's disc; `chance` selects it.
Vector pointOf(const Lamp& lamp, unsigned chance) {
  const double radius = lamp.radius_m * std::sqrt(randomAt(1, 0, chance)),
               angle = 2.0 * M_PI * randomAt(2, 0, chance);
  return lamp.at_m + Vector(radius * std::cos(angle), radius * std::sin(angle), 0.0);
}

/// Ambient light and lamps. Solids darken the floor at their foot (contact shadow).
double lightAt(const Room& room, const std::vector<Placed>& solids, const Hit& hit, const Vector& at,
               unsigned chance) {
  double light = room.ambient * (0.6 + 0.4 * hit.normal.z());
  for (const Placed& placed : solids) {
    if (hit.solid != nullptr) break;
    const Solid& solid = *placed.solid;
    if (solid.surface != Surface::kMatt) continue;
    const double inner = 0.5 * (solid.round ? solid.size_m.x() : solid.size_m.minCoeff());
    if ((at.head<2>() - placed.middle_m).squaredNorm() > 1.001 * (inner + 0.3) * (inner + 0.3)) continue;
    const double gap = std::max(0.0, (at.head<2>() - placed.middle_m).norm() - inner);
    if (gap < 0.3) light *= 1 - solid.height_m / (solid.height_m + gap) * 0.45 * std::exp(-gap / 0.06);
  }
  for (const Lamp& lamp : room.lamps) {
    const Vector to = lamp.at_m - at;
    if (lamp.radius_m > 0.0 && isHidden(solids, at + 1e-4 * hit.normal, pointOf(lamp, chance))) continue;
    light += 4.0 * lamp.power * std::max(0.0, to.normalized().dot(hit.normal)) / to.squaredNorm();
  }
  return light;
}

}  // namespace

std::vector<Placed> placedIn(const Room& room, const std::vector<Solid>& robots) {
  std::vector<Placed> solids;
  for (const auto* list : {&room.solids, &robots})
    for (const Solid& solid : *list) solids.emplace_back(solid);
  return solids;
}

Hit firstHit(const std::vector<Placed>& solids, const Vector& from, const Vector& along) {
  Hit hit;
  for (const Placed& solid : solids) intersect(solid, from, along, hit);
  const double floor_m = along.z() < 0 ? -from.z() / along.z() : kNone;
  if (hit.solid == nullptr && floor_m > kFarthest_m) return hit;
  if (floor_m < hit.range_m) hit = {floor_m, Vector::UnitZ(), nullptr, nullptr};
  return hit;
}

Vector radianceOf(const Room& room, const std::vector<Placed>& solids, const Hit& hit, const Vector& from,
                  const Vector& along, unsigned chance, double blur_rad, int bounces) {
  constexpr int kMostBounces = 3;
  constexpr double kMirrored = 0.9, kReflected = 0.08, kTransmitted = 0.88, kPast_m = 1e-4;
  if (hit.range_m == kNone) {
    const bool skirting = std::abs(along.z()) < 0.12;
    return skirting ? Vector(0.3, 0.28, 0.25) : Vector((0.25 + 0.15 * along.z()) * Vector(1.0, 1.0, 1.03));
  }
  const Vector at = from + hit.range_m * along;
  const Surface surface = hit.solid == nullptr ? Surface::kMatt : hit.solid->surface;
  if (surface != Surface::kMatt) {
    if (bounces == kMostBounces) return Vector::Zero();
    const Vector reflected = along - 2.0 * along.dot(hit.normal) * hit.normal;
    const auto follow = [&](const Vector& to) {
      const Vector past = at + kPast_m * to;
      return radianceOf(room, solids, firstHit(solids, past, to), past, to, chance, blur_rad, bounces + 1);
    };
    if (surface == Surface::kMirror) return kMirrored * follow(reflected);
    return kTransmitted * follow(along) + kReflected * follow(reflected);
  }
  const double light = lightAt(room, solids, hit, at, chance);
  if (hit.solid == nullptr) return light * floorAlbedo(room, at.head<2>(), blur_rad * hit.range_m);
  return light * albedoOf(room, hit, at);
}

double angleAt(const lens::CameraModel& camera, double radius_px) {
  const double r = radius_px / camera.focal_px.x();
  double angle = r;
  if (camera.projection == lens::Projection::kEquisolid) angle = 2 * std::asin(std::min(1.0, 0.5 * r));
  if (camera.projection == lens::Projection::kStereographic) angle = 2 * std::atan(0.5 * r);
  return angle <= camera.fov_deg * M_PI / 360.0 ? angle : -1.0;
}

double toneOf(const Room& room, double linear) {
  if (room.is_linear) return 255.0 * linear;
  return 255.0 * (linear <= 0.0031308 ? 12.92 * linear : 1.055 * std::pow(linear, 1 / 2.4) - 0.055);
}

}  // namespace omnifleet::raycast
