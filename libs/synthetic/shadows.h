#pragma once

#include <Eigen/Core>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// Shadows of obstacles and robots on the floor in the light of `sun`. The shadow of an upright prism of
/// height h is its footprint swept along −h·(sun.x, sun.y)/sun.z. The width of its rim is `cast_softness`
/// times the height that casts it.
class Shadows {
 public:
  explicit Shadows(const Arena& arena);

  /// Sets the current poses; `map_from_bases` has one pose per robot.
  void place(double time_s, const std::vector<Pose2>& map_from_bases);

  bool any() const { return arena_->light.cast_shadow > 0.0; }
  /// Share of the light that reaches a position of the floor; 1 outside all shadows.
  float at(const Eigen::Vector2f& place_m) const;

 private:
  struct Caster {
    Solid solid;
    Pose2 map_from_solid;
    Eigen::Vector2f middle_m;  ///< centre of a circle that contains footprint and shadow
    float reach_m;
  };
  void add(const Solid& solid, const Pose2& map_from_solid);
  double coverageOf(const Caster& caster, const Eigen::Vector2d& place_m) const;

  const Arena* arena_;
  Eigen::Vector2d shadow_per_height_ =
      Eigen::Vector2d::Zero();  ///< displacement of the shadow per metre of height
  std::vector<Caster> casters_;
};

}  // namespace omnifleet::synthetic
