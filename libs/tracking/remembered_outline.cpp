#include "tracking/remembered_outline.h"

#include <algorithm>
#include <cmath>
#include <utility>

namespace omnifleet::tracking {
namespace {

constexpr double kSameSight_m = 0.10;

}  // namespace

void RememberedOutline::add(const View& view, const PrismFilter& filter) {
  next_ = view.supports;
  if (isGood(view)) {
    for (std::size_t k = 0; k < view.size(); ++k) {
      const double before = fromHere(outermost_, view, k, filter);
      if (!std::isfinite(before) || (view.usable(k) && next_.b_m[k] >= before)) continue;
      next_.b_m[k] = static_cast<float>(before);
      next_.sigma_m[k] = view.usable(k) ? view.supports.sigma_m[k] : 1.0F;
    }
  } else {
    origin_m_ = view.foot_m;
  }
  last_ = view;
  std::swap(outermost_, next_);
}

bool RememberedOutline::isGood(const View& view) const {
  return !last_.supports.empty() && (view.foot_m - origin_m_).norm() < kSameSight_m;
}

double RememberedOutline::fromHere(const SupportFunction& then, const View& view, std::size_t k,
                                   const PrismFilter& filter) const {
  const double seen_m = then.at(view.angle(k) - last_.heading_rad).b_m;
  return seen_m + filter.predictedSupport(view, k) - filter.predictedSupport(last_.foot_m, view.angle(k));
}

double RememberedOutline::expectedSupport(const View& view, std::size_t k, const PrismFilter& filter) const {
  double nearest = filter.predictedSupport(view, k);
  double least = INFINITY;
  for (const SupportFunction* then : {&last_.supports, &outermost_}) {
    const double remembered = fromHere(*then, view, k, filter);
    const double away = std::abs(remembered - view.supports.b_m[k]);
    if (!(away < least)) continue;
    least = away;
    nearest = remembered;
  }
  return nearest;
}

}  // namespace omnifleet::tracking
