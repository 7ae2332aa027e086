#pragma once

#include <vector>

#include "tracking/view.h"

namespace omnifleet::tracking {

/// A known body fitted to one view.
struct BodyFit {
  bool valid = false;                                  ///< false where too few directions are usable
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();  ///< the footprint's Steiner point, odom
  double heading_rad = 0.0;                            ///< odom; 0 for round bodies
  double rms_m = 0.0;  ///< residual on the floor under the object, directions weighted by their noise
  double arc = 0.0;    ///< share of usable directions, each counted with its weight
};

/// The support-function prism with known footprint and height (docs/methods/classifier.md): only position and
/// heading are estimated. Round bodies have a closed form. Other bodies are fitted once per heading, on the
/// grid of the support directions. An rms below 5 cm indicates a robot. The constructor computes the support
/// table once.
class BodyModel {
 public:
  explicit BodyModel(const RobotBody& body);
  BodyFit fit(const View& view) const;

  /// Support of the silhouette seen from `view` in direction k, metres from the camera foot, for a body with
  /// its footprint centre at `centre_m` (odom) and the given heading.
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
