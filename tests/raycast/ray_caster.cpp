#include "tests/raycast/ray_caster.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <opencv2/core/utility.hpp>
#include <random>

#include "tests/raycast/value_noise.h"

namespace omnifleet::raycast {
namespace {

using Vector = Eigen::Vector3d;

constexpr double kFarthest_m = 20.0;  // farther floor is rendered as haze
constexpr double kNone = std::numeric_limits<double>::infinity();

struct Hit {
  double range_m = kNone;
  Vector normal = Vector::UnitZ();
  const Solid* solid = nullptr;
};

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
  best = {enter, normal, &solid};
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
      best = {range, Vector(at.x() / radius, at.y() / radius, 0.0), &solid};
  }
  if (along.z() >= 0) return;
  const double range = (solid.height_m - from.z()) / along.z();
  const Vector at = from + range * along;
  if (isNearer(range) && at.head<2>().norm() < radius) best = {range, Vector::UnitZ(), &solid};
}

/// A solid with what does not change from ray to ray.
struct Placed {
  explicit Placed(const Solid& s)
      : solid(&s),
        rotation(s.map_from_solid.inverse().rotation()),
        translation(s.map_from_solid.inverse().translation()),
        middle_m(s.map_from_solid.translation()),
        reach2_m2((s.round ? 0.25 * s.size_m.x() * s.size_m.x() : 0.25 * s.size_m.squaredNorm()) + 1e-9) {}

  /// False if the vertical plane of the ray passes beside the solid.
  bool mayMeet(const Vector& from, const Vector& along) const {
    const Eigen::Vector2d to = middle_m - from.head<2>();
    const double length2 = along.head<2>().squaredNorm(), cross = along.x() * to.y() - along.y() * to.x();
    if (cross * cross > reach2_m2 * length2) return false;
    return along.head<2>().dot(to) >= 0.0 || to.squaredNorm() <= reach2_m2;
  }

  const Solid* solid;
  Eigen::Matrix2d rotation;  ///< map to solid
  Eigen::Vector2d translation, middle_m;
  double reach2_m2;  ///< squared radius of the circle around the footprint
};

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
    const Eigen::Vector2d turned = placed.rotation.transpose() * best.normal.head<2>();
    best.normal.head<2>() = turned;
  }
}

Vector parquet(Vector albedo, double x, double y, unsigned seed) {
  constexpr double kWide = 0.09, kLong = 0.9;
  const int row = static_cast<int>(std::floor(y / kWide));
  const double along = (x + 0.37 * row + randomAt(row, 7, seed)) / kLong;
  const int plank = static_cast<int>(std::floor(along));
  const double bright = 1 + 0.18 * (randomAt(row, plank, seed) - 0.5),
               hue = 0.05 * (randomAt(row, plank, seed + 1) - 0.5),
               texture = 1 + 0.10 * (smoothAt(8 * x, 150 * y, seed + 2) - 0.5);
  albedo = bright * texture * albedo.cwiseProduct(Vector(1 + hue, 1.0, 1 - hue));
  const bool joint = y / kWide - row < 0.012 || along - plank < 0.0015;
  return joint ? Vector(0.55 * albedo) : albedo;
}

/// Each fibre (cell of 4 mm) has its own random hue.
Vector carpet(Vector albedo, double x, double y, unsigned seed) {
  constexpr double kFibre = 0.004;
  const int i = static_cast<int>(std::floor(x / kFibre)), j = static_cast<int>(std::floor(y / kFibre));
  for (unsigned k = 0; k < 3; ++k) albedo[k] *= 1 + 0.35 * (randomAt(i, j, seed + k) - 0.5);
  return (1 + 0.15 * (smoothAt(6 * x, 6 * y, seed) - 0.5)) * albedo;
}

Vector lino(const Vector& albedo, double x, double y, unsigned seed) {
  return (1 + 0.16 * (smoothAt(15 * x + 4 * smoothAt(3 * x, 3 * y, seed), 15 * y, seed + 3) - 0.5)) * albedo;
}

Vector concrete(const Vector& albedo, double x, double y, unsigned seed) {
  const double stain = std::max(0.0, smoothAt(1.3 * x, 1.3 * y, seed + 5) - 0.65);
  const double mottle =
      1 + 0.10 * (smoothAt(40 * x, 40 * y, seed) - 0.5) + 0.12 * (smoothAt(4 * x, 4 * y, seed + 2) - 0.5);
  return mottle * (1 - 0.6 * stain) * albedo;
}

Vector floorAt(const Room& room, const Eigen::Vector2d& at) {
  for (auto marking = room.markings.rbegin(); marking != room.markings.rend(); ++marking) {
    const Eigen::Vector2d own = marking->map_from_marking.inverse() * at;
    if ((2.0 * own.cwiseAbs() - marking->size_m).maxCoeff() < 0) return marking->albedo;
  }
  switch (room.floor) {
    case Floor::kParquet:
      return parquet(room.floor_albedo, at.x(), at.y(), room.seed);
    case Floor::kCarpet:
      return carpet(room.floor_albedo, at.x(), at.y(), room.seed);
    case Floor::kConcrete:
      return concrete(room.floor_albedo, at.x(), at.y(), room.seed);
    case Floor::kPlain:
      return room.floor_albedo;
    default:
      return lino(room.floor_albedo, at.x(), at.y(), room.seed);
  }
}

Vector colourOf(const Room& room, const Hit& hit, const Vector& at) {
  if (hit.solid == nullptr) return floorAt(room, at.head<2>());
  const int square =
      static_cast<int>(std::floor(25 * at.z())) + static_cast<int>(std::floor(15 * (at.x() + at.y())));
  return (hit.solid->chequered && square % 2 != 0 ? 0.7 : 1.0) * hit.solid->albedo;
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

Vector radianceAlong(const Room& room, const std::vector<Placed>& solids, const Vector& from,
                     const Vector& along, unsigned chance, int bounces = 0) {
  constexpr int kMostBounces = 3;
  constexpr double kMirrored = 0.9, kReflected = 0.08, kTransmitted = 0.88, kPast_m = 1e-4;
  Hit hit;
  for (const Placed& solid : solids) intersect(solid, from, along, hit);
  const double floor_m = along.z() < 0 ? -from.z() / along.z() : kNone;
  if (hit.solid == nullptr && floor_m > kFarthest_m) {
    const bool skirting = std::abs(along.z()) < 0.12;
    return skirting ? Vector(0.3, 0.28, 0.25) : Vector((0.25 + 0.15 * along.z()) * Vector(1.0, 1.0, 1.03));
  }
  if (floor_m < hit.range_m) hit = {floor_m, Vector::UnitZ(), nullptr};
  const Vector at = from + hit.range_m * along;
  const Surface surface = hit.solid == nullptr ? Surface::kMatt : hit.solid->surface;
  if (surface != Surface::kMatt) {
    if (bounces == kMostBounces) return Vector::Zero();
    const Vector reflected = along - 2.0 * along.dot(hit.normal) * hit.normal;
    const auto follow = [&](const Vector& to) {
      return radianceAlong(room, solids, at + kPast_m * to, to, chance, bounces + 1);
    };
    if (surface == Surface::kMirror) return kMirrored * follow(reflected);
    return kTransmitted * follow(along) + kReflected * follow(reflected);
  }
  return lightAt(room, solids, hit, at, chance) * colourOf(room, hit, at);
}

/// Angle off the optical axis, radians; −1 outside of the image circle.
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

}  // namespace

cv::Mat3b render(const Room& room, const lens::CameraModel& camera, const Pose2& map_from_camera,
                 const std::vector<Solid>& robots, unsigned frame) {
  constexpr int kSamples = 2;  // per axis
  std::vector<Placed> solids;
  for (const auto* list : {&room.solids, &robots})
    for (const Solid& solid : *list) solids.emplace_back(solid);
  cv::Mat3b image(camera.image_height_px, camera.image_width_px, cv::Vec3b(0, 0, 0));
  const Vector from(map_from_camera.x_m, map_from_camera.y_m, camera.position_m.z());
  cv::parallel_for_({0, image.rows}, [&](const cv::Range& rows) {
    for (int v = rows.start; v < rows.end; ++v) {
      std::mt19937 random(mixed(room.seed) ^ mixed(frame * 4099U + static_cast<unsigned>(v)));
      std::normal_distribution<double> noise(0.0, room.noise);
      for (int u = 0; u < image.cols; ++u) {
        Vector sum = Vector::Zero();
        bool seen = true;
        for (int k = 0; k < kSamples * kSamples && seen; ++k) {
          const Eigen::Vector2d off = Eigen::Vector2d(u + (k % kSamples + 0.5) / kSamples - 0.5,
                                                      v + (k / kSamples + 0.5) / kSamples - 0.5) -
                                      camera.principal_point_px;
          const double angle = angleAt(camera, off.norm());
          seen = angle >= 0.0;
          if (!seen) break;
          const Eigen::Vector2d ahead = Eigen::Vector2d(-off.y(), -off.x()) / std::max(1e-9, off.norm());
          const Eigen::Vector2d turned = map_from_camera.rotation() * ahead;
          const double off_axis = angle / (0.5 * M_PI), reaches = 1.0 - room.vignette * off_axis * off_axis;
          const unsigned chance = mixed(static_cast<unsigned>(u) * 4U + static_cast<unsigned>(k)) ^
                                  mixed(frame * 8191U + static_cast<unsigned>(v));
          sum += reaches *
                 radianceAlong(room, solids, from,
                               {std::sin(angle) * turned.x(), std::sin(angle) * turned.y(), -std::cos(angle)},
                               chance);
        }
        if (!seen) continue;
        for (int c = 0; c < 3; ++c)
          image(v, u)[2 - c] = cv::saturate_cast<std::uint8_t>(
              toneOf(room, room.light * sum[c] / (kSamples * kSamples)) + noise(random));
      }
    }
  });
  return image;
}

dataset::MapObject truthOf(const Solid& solid, std::uint64_t id) {
  constexpr int kCorners = 48;
  dataset::MapObject object;
  object.id = id;
  object.height_m = solid.height_m;
  for (int k = 0; k < (solid.round ? kCorners : 4); ++k) {
    const double angle = 2.0 * M_PI * (k + (solid.round ? 0.0 : 0.5)) / (solid.round ? kCorners : 4);
    const Eigen::Vector2d corner =
        solid.round
            ? Eigen::Vector2d(0.5 * solid.size_m.x() * Eigen::Vector2d(std::cos(angle), std::sin(angle)))
            : Eigen::Vector2d(std::copysign(0.5 * solid.size_m.x(), std::cos(angle)),
                              std::copysign(0.5 * solid.size_m.y(), std::sin(angle)));
    object.outline_m.push_back(solid.map_from_solid * corner);
  }
  object.centroid_m = solid.map_from_solid.translation();
  return object;
}

}  // namespace omnifleet::raycast
