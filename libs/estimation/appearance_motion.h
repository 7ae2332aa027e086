#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimation/compass_quality.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::estimation {

struct AppearanceOptions {
  bool use = true;  ///< the visual compass and the distance of signatures correct the motion
  /// The compass corrects the turns of wheels, too. It rescues a robot whose wheels slip for many seconds; in
  /// arenas of few obstacles it costs accuracy, so it is off (docs/results.md).
  bool with_wheels = false;
  double least_confidence = 0.3;  ///< 1, of a turn by the compass
  double sigma_factor = 1.0;      ///< 1, on the σ of the compass
  double robust_sigmas = 2.0;     ///< σ at which a turn of the compass counts half (Cauchy)
  double memory_steps = 50.0;     ///< steps over which the scale of the distance of signatures is learned
  double prior_steps = 5.0;       ///< steps from which it is used
  /// The distance of signatures counts as metres until its scale is estimated, and steps are as uncertain
  /// as they are long: the map of Fernández et al. 2011, whose scale is free.
  bool free_scale = false;
  CompassQualityOptions quality;
  static AppearanceOptions read(const options::Section& section);
};

/// Length of a step from the distance D of two signatures (Fernández et al. 2011 eq. 2, normalised). In the
/// surroundings of a place both are about proportional, but a turn changes panoramas, too: the body, the lens
/// and the floor are not the same in all directions. So length = α·D + β·|turn| + γ is fitted to steps of
/// known length (Bayesian linear regression with forgetting). The σ of a length covers what the steps so far
/// have not determined: a robot that has only turned on the spot does not know α.
class DifferenceScale {
 public:
  explicit DifferenceScale(const AppearanceOptions& options = {});

  /// A step of a known length.
  void add(double length_m, double difference, double turn_rad);

  struct Length {
    double m = 0.0, sigma_m = 0.0;
  };
  /// Length of a step; nothing while the scale is unknown.
  std::optional<Length> lengthOf(double difference, double turn_rad) const;
  /// Steps of known length have determined it.
  bool isMetric() const { return weight_ >= options_.prior_steps; }

 private:
  AppearanceOptions options_;
  double weight_ = 0.0;                                ///< of the steps
  Eigen::Matrix3d moments_ = Eigen::Matrix3d::Zero();  ///< Σ x·xᵀ, x = (D, |turn|, 1)
  Eigen::Vector3d lengths_ = Eigen::Vector3d::Zero();  ///< Σ x · length
  double squares_ = 0.0;                               ///< Σ length²
};

/// Whether the compass has measured the turn of a frame since the time of the one before.
bool hasTurn(const Appearance& appearance, TimeNs since_ns, const AppearanceOptions& options);

}  // namespace omnifleet::estimation
