#include "estimation/appearance_motion.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::estimation {
namespace {

constexpr double kFreeShare = 0.3;  // σ of a step of free scale, as a share of its length

}  // namespace

AppearanceOptions AppearanceOptions::read(const options::Section& section) {
  AppearanceOptions o;
  section.read("use", o.use);
  section.read("with_wheels", o.with_wheels);
  section.read("least_confidence", o.least_confidence, {0.0, 1.0});
  section.read("sigma_factor", o.sigma_factor, {0.1, 100.0});
  section.read("robust_sigmas", o.robust_sigmas, {0.1, 100.0});
  section.read("memory_steps", o.memory_steps, {1.0, 1e6});
  section.read("prior_steps", o.prior_steps, {1.0, 1e6});
  section.read("free_scale", o.free_scale);
  o.quality = CompassQualityOptions::read(section.child("quality"));
  section.finish();
  return o;
}

void DifferenceScale::add(double length_m, double difference) {
  if (!(difference > 0)) return;
  const double keep = 1.0 - 1.0 / options_.memory_steps;
  weight_ = keep * weight_ + 1.0;
  dd_ = keep * dd_ + difference * difference;
  ld_ = keep * ld_ + length_m * difference;
  ll_ = keep * ll_ + length_m * length_m;
}

std::optional<DifferenceScale::Length> DifferenceScale::lengthOf(double difference) const {
  if (!isMetric() || !(dd_ > 0)) {
    if (!options_.free_scale) return std::nullopt;
    return Length{difference, kFreeShare * difference};
  }
  const double scale = ld_ / dd_, residual = std::max(0.0, ll_ - scale * ld_) / weight_;
  return Length{scale * difference, std::sqrt(residual)};
}

bool hasTurn(const Appearance& appearance, TimeNs since_ns, const AppearanceOptions& options) {
  return options.use && appearance.since_ns != 0 && appearance.since_ns == since_ns &&
         appearance.turn_sigma_rad > 0 && appearance.confidence >= options.least_confidence;
}

}  // namespace omnifleet::estimation
