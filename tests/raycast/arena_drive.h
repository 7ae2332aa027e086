#pragma once

#include <vector>

#include "tests/raycast/arena_layout.h"

namespace omnifleet::raycast {

/// Places on the faces of blocks and walls, to count what the front cameras have shown.
class FaceSamples {
 public:
  explicit FaceSamples(const House& house);

  std::size_t size() const { return at_m_.size(); }
  const Eigen::Vector2d& at(std::size_t sample) const { return at_m_[sample]; }
  /// Unseen samples within sight of a place in any direction.
  std::vector<std::size_t> unseenFrom(const Eigen::Vector2d& from) const;
  /// Marks what the front camera of a robot shows.
  void look(const Pose2& map_from_base);
  double seenShare() const;

 private:
  bool isVisible(std::size_t sample, const Eigen::Vector2d& from) const;

  std::vector<Solid> solids_;
  std::vector<Eigen::Vector2d> at_m_, outward_;
  std::vector<char> seen_;
};

/// Poses of the two mapping robots in steps of kTick_s from time 0.
class ArenaDrive {
 public:
  static constexpr double kTick_s = 0.02;

  /// Robots drive to places from which unseen faces are visible, turn towards them, and keep clear of
  /// everything. Throws std::runtime_error if there is no place to start.
  ArenaDrive(const ArenaLayout& layout, double duration_s, Random& random);

  /// Pose of r1 (0) or r2 (1), interpolated between two steps.
  Pose2 at(int robot, double time_s) const;
  double seenShare() const { return seen_share_; }  ///< of the faces, by both front cameras

 private:
  std::vector<std::vector<Pose2>> poses_;  ///< per robot
  double seen_share_ = 0.0;
};

}  // namespace omnifleet::raycast
