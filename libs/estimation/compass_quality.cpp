#include "estimation/compass_quality.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::estimation {
namespace {

constexpr double kReferenceSigmas = 2.0;  // by which a sum of correlated references may err

}  // namespace

CompassQualityOptions CompassQualityOptions::read(const options::Section& section) {
  CompassQualityOptions o;
  section.read("memory_steps", o.memory_steps, {2.0, 1e6});
  section.read("prior_steps", o.prior_steps, options::kPositive);
  section.read("most_rad", o.most_rad, options::kPositive);
  section.finish();
  return o;
}

void CompassQuality::add(double error_rad, double sigma_rad, const Reference& reference) {
  if (!(std::abs(error_rad) < options_.most_rad) || !(sigma_rad > 0)) return;
  const double keep = 1.0 - 1.0 / options_.memory_steps, error = error_rad / sigma_rad,
               known = reference.sigma_rad / sigma_rad;
  steps_ = keep * steps_ + 1.0;
  errors_ = keep * errors_ + error;
  squares_ = keep * squares_ + error * error;
  correlated_ = keep * correlated_ + (reference.correlated ? kReferenceSigmas * known : 0.0);
  references_ = keep * references_ + known * known;
  references2_ = keep * references2_ + known * known * known * known;
  // References that measure headings add the errors of two headings to a sum of turns: not worth counting.
  // What may be an error of the references by chance, up to the standard error of its sum, is none of the
  // compass.
  const double single = squares_ - references_ - std::sqrt(2.0 * references2_),
               summed = errors_ * errors_ - correlated_ * correlated_;
  scale_ = std::sqrt(
      std::max(1.0, (std::max(single, summed) + options_.prior_steps) / (steps_ + options_.prior_steps)));
}

}  // namespace omnifleet::estimation
