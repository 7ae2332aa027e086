#include "estimation/compass_evidence.h"

#include <algorithm>
#include <cmath>

#include "geometry/pose2.h"

namespace omnifleet::estimation {

double compassEvidence(const appearance::CompassResult& answer, double turn_rad, double sigma_rad,
                       double most_confidence) {
  if (!answer.valid) return 0.0;
  const double sure = std::min(answer.confidence, most_confidence),
               sigma = std::hypot(answer.sigma_rad, sigma_rad),
               off = wrapAngle(turn_rad - answer.turn_rad) / sigma;
  return std::log(1.0 - sure + sure * std::sqrt(2.0 * M_PI) / sigma * std::exp(-0.5 * off * off));
}

appearance::TravelHint hintOf(const Pose2& from_to) {
  appearance::TravelHint hint;
  hint.distance_m = from_to.translation().norm();
  hint.bearing_rad = wrapAngle(std::atan2(from_to.y_m, from_to.x_m) - 0.5 * from_to.theta_rad);
  return hint;
}

}  // namespace omnifleet::estimation
