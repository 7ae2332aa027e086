#pragma once

#include <Eigen/Core>
#include <vector>

#include "synthetic/arena.h"

namespace omnifleet::synthetic {

/// Shadows that obstacles and robots throw on the floor in the light of `sun`: an upright prism of height h
/// shades its footprint swept along −h·(sun.x, sun.y)/sun.z; the rim is as wide as `cast_softness` times the
/// height that throws it.
class Shadows {
 public:
  explicit Shadows(const Arena& arena);

  /// Where everything stands now; `map_from_bases` one per robot.
  void place(double time_s, const std::vector<Pose2>& map_from_bases);

  bool any() const { return arena_->light.cast_shadow > 0.0; }
  /// Share of the light that reaches a place of the floor, 1 outside of all shadows.
  float at(const Eigen::Vector2f& place_m) const;

 private:
  struct Caster {
    Solid solid;
    Pose2 map_from_solid;
    Eigen::Vector2f middle_m;  ///< of a circle that holds footprint and shadow
    float reach_m;
  };
  void add(const Solid& solid, const Pose2& map_from_solid);
  double coverOf(const Caster& caster, const Eigen::Vector2d& place_m) const;

  const Arena* arena_;
  Eigen::Vector2d throw_ = Eigen::Vector2d::Zero();  ///< shadow's way per metre of height
  std::vector<Caster> casters_;
};

}  // namespace omnifleet::synthetic
