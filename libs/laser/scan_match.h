#pragma once

#include "laser/beams.h"

namespace omnifleet::laser {

/// Motion between two scans, assuming that the surroundings are static. Point to line, as Censi 2008, "An ICP
/// variant using a point-to-line metric", with two departures: the wheels are a weak prior, so that a
/// corridor or an empty room changes nothing along itself. Points with a large residual lose weight (Cauchy)
/// instead of being trimmed, because other robots move. In a room without walls robots may be most of the
/// scan: only beams with Beam::is_static define lines.
class ScanMatcher {
 public:
  /// Returns `wheels`, corrected where this scan and the previous one determine the motion. Wheels that
  /// report once per scan do not show how their speed changed since. Stores the scan.
  /// @param origin_m the scanner in base_link. A motion that is not valid is returned unchanged.
  Motion refine(const Beams& scan, const Eigen::Vector2d& origin_m, double range_sigma_m,
                const Motion& wheels);
  /// Clears the stored scan: the next scan has no predecessor.
  void forget() { before_.beam.clear(); }

 private:
  struct Line {
    Eigen::Vector2d at = Eigen::Vector2d::Zero(), normal = Eigen::Vector2d::Zero();
    bool valid = false;
  };
  /// Normal equations of a step (x, y, θ) in the current base_link.
  struct Normal {
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  };
  void fitLines();
  int gather(const Beams& scan, const Eigen::Vector2d& origin_m, double variance, const Pose2& pose,
             double within_m, Normal& normal) const;
  Motion match(const Beams& scan, const Eigen::Vector2d& origin_m, double range_sigma_m,
               const Motion& wheels) const;
  const Line* nearest(const Eigen::Vector2d& point_m, double within_m) const;

  Beams before_;
  std::vector<Line> lines_;  ///< of `before_`, per beam
};

}  // namespace omnifleet::laser
