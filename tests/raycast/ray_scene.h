#pragma once

#include <Eigen/Core>
#include <limits>
#include <vector>

#include "tests/raycast/ray_caster.h"

/// Rays in a room, for the two samplers of images (ray_caster.h, adaptive_render.h).
namespace omnifleet::raycast {

/// A solid with what does not change from ray to ray.
struct Placed {
  explicit Placed(const Solid& s)
      : solid(&s),
        rotation(s.map_from_solid.inverse().rotation()),
        translation(s.map_from_solid.inverse().translation()),
        middle_m(s.map_from_solid.translation()),
        reach2_m2((s.round ? 0.25 * s.size_m.x() * s.size_m.x() : 0.25 * s.size_m.squaredNorm()) + 1e-9) {}

  /// False if the vertical plane of the ray passes beside the solid.
  bool mayMeet(const Eigen::Vector3d& from, const Eigen::Vector3d& along) const {
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

struct Hit {
  double range_m = std::numeric_limits<double>::infinity();  ///< infinity: the haze behind everything
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  const Solid* solid = nullptr;  ///< null: floor or haze
  const Placed* placed = nullptr;
};

std::vector<Placed> placedIn(const Room& room, const std::vector<Solid>& robots);

/// What a ray meets first. `along` is a unit vector.
Hit firstHit(const std::vector<Placed>& solids, const Eigen::Vector3d& from, const Eigen::Vector3d& along);

/// Light (R, G, B) that reaches `from` from a hit.
/// @param chance selects the points of the lamps that cast shadows
/// @param blur_rad width of the pixel; 0: the ray is a line
Eigen::Vector3d radianceOf(const Room& room, const std::vector<Placed>& solids, const Hit& hit,
                           const Eigen::Vector3d& from, const Eigen::Vector3d& along, unsigned chance,
                           double blur_rad = 0.0, int bounces = 0);

/// Angle of a pixel off the optical axis, radians; −1 outside of the image circle.
double angleAt(const lens::CameraModel& camera, double radius_px);

/// Response of the camera to light, grey levels.
double toneOf(const Room& room, double linear);

}  // namespace omnifleet::raycast
