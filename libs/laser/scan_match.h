#pragma once

#include "laser/beams.h"

namespace omnifleet::laser {

/// A robot's motion between two of its scans: what stands has not moved. Point to line, as Censi 2008, "An
/// ICP variant using a point-to-line metric", with two departures: wheels are a weak prior, so that a
/// corridor or a bare room changes nothing along itself, and what fits badly counts little (Cauchy) instead
/// of being trimmed: other robots drive. In a room without walls they may be most of what is seen: what is to
/// be matched says Beam::stands.
class ScanMatcher {
 public:
  /// `wheels`, corrected where this scan and the one before tell. Wheels that report once per scan say
  /// nothing of how their speed changed since. The scan is remembered.
  /// @param origin_m the scanner in base_link. Motions that are not valid stay as they are.
  Motion refine(const Beams& scan, const Eigen::Vector2d& origin_m, double range_sigma_m,
                const Motion& wheels);
  /// The next scan has no predecessor.
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
