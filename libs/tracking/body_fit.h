#pragma once

#include <vector>

#include "tracking/view.h"

namespace omnifleet::tracking {

/// A known body laid over one view.
struct BodyFit {
  bool valid = false;                                  ///< false where too little of the outline is usable
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();  ///< the footprint's Steiner point, odom
  double heading_rad = 0.0;                            ///< odom; 0 for round bodies
  double rms_m = 0.0;  ///< residual on the floor under the object, each direction eased by its own noise
  double arc = 0.0;    ///< share of directions that were usable
};

/// The support-function prism with everything known but the place (docs/methods.md, "Known bodies": the same
/// model with the known body, solving position only; rms < 5 cm is a robot): closed form for round bodies,
/// and per heading (grid of the support directions) for the others. The body's tables are made once.
class BodyModel {
 public:
  explicit BodyModel(const RobotBody& body);
  BodyFit fit(const View& view) const;

  /// Support function of the silhouette seen from `view`, direction k, for a body at `centre_m` with a
  /// heading.
  double predictedSupport(const View& view, std::size_t k, const Eigen::Vector2d& centre_m,
                          double heading_rad) const;
  double meanRadius() const { return mean_radius_m_; }
  double height() const { return height_m_; }
  bool round() const { return round_; }
  /// From the origin of base_link to the footprint's centre, in base_link.
  const Eigen::Vector2d& offset() const { return offset_m_; }

 private:
  double support(double angle_rad) const;
  BodyFit fitAt(const View& view, double heading_rad) const;

  std::vector<double> support_m_;  ///< of the outline about its Steiner point, in base_link
  bool round_;
  double mean_radius_m_ = 0.0;
  double height_m_;
  Eigen::Vector2d offset_m_ = Eigen::Vector2d::Zero();
};

}  // namespace omnifleet::tracking
