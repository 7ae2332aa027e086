#pragma once

#include <optional>

#include "estimation/compass_quality.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::estimation {

struct AppearanceOptions {
  bool use = true;  ///< the visual compass and the distance of signatures correct the motion
  /// The compass corrects the turns of wheels, too. Measured: on open floor with a few near objects its
  /// errors are several times its σ and go one way, so good wheels become worse (headings of the demo .015° →
  /// .031°).
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

/// Metres per unit of the distance of two signatures (Fernández et al. 2011 eq. 2, normalised), learned from
/// steps of known length. In the surroundings of a place the two are about proportional.
class DifferenceScale {
 public:
  explicit DifferenceScale(const AppearanceOptions& options = {}) : options_(options) {}

  /// A step of a known length.
  void add(double length_m, double difference);

  struct Length {
    double m = 0.0, sigma_m = 0.0;
  };
  /// Length of a step; nothing while the scale is unknown.
  std::optional<Length> lengthOf(double difference) const;
  /// Steps of known length have determined it.
  bool isMetric() const { return weight_ >= options_.prior_steps; }

 private:
  AppearanceOptions options_;
  double weight_ = 0.0;                    ///< of the steps
  double dd_ = 0.0, ld_ = 0.0, ll_ = 0.0;  ///< sums of difference², length · difference, length²
};

/// Whether the compass has measured the turn of a frame since the time of the one before.
bool hasTurn(const Appearance& appearance, TimeNs since_ns, const AppearanceOptions& options);

}  // namespace omnifleet::estimation
