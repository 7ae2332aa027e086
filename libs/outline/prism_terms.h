#pragma once

// Inside libs/outline: the prism's equation per view and direction, shared by the fits.

#include <vector>

#include "outline/prism.h"

namespace omnifleet::outline::detail {

/// h_P(n) = a − h·b per view and direction (see fitPrism), a = n·c + b(n), b = PrismView::perHeight(); σ of
/// b(n), ≤ 0 unusable.
struct Term {
  double a = 0.0, b = 0.0, sigma = 0.0;
};

struct Terms {
  int directions = 0;
  std::vector<Eigen::Vector2d> normals;  ///< map
  std::vector<int> view;                 ///< index of the given view
  std::vector<double> camera_height_m;
  std::vector<Term> term;   ///< [view][direction]
  bool tops_alone = false;  ///< of some views: no tangent to a shadow is seen

  std::size_t views() const { return view.size(); }
  const Term& at(std::size_t v, int k) const {
    return term[v * static_cast<std::size_t>(directions) + static_cast<std::size_t>(k)];
  }
  /// σ of h_P(n) at height h: a shadow edge is scaled down by 1/s.
  double sigmaAt(std::size_t v, int k, double height_m, double noise_m) const;
};

/// Height of the lowest camera; 0 where all views are lasers'.
double lowestCamera(const Terms& terms);

/// Views without supports, without height or with a non-finite pose are left out.
Terms termsOf(const std::vector<PrismView>& views, int directions, double noise_m);

/// Of more than `count` views, those that tell most, taken in turn from 24 sectors around the object.
Terms mostTelling(const Terms& terms, const std::vector<PrismView>& views, std::size_t count);

/// Widest gap between directions whose σ > 0, radians (2π when none).
double widestGap(const std::vector<DirectionEvidence>& evidence);

/// Convex polygon whose support function is nearest to the evidence (about the origin of map).
Polygon polygonOf(const std::vector<DirectionEvidence>& evidence);

/// Support function of a polygon in a direction.
double supportOf(const Polygon& polygon, const Eigen::Vector2d& normal);

/// Height from one view by the tangents; sigma ≤ 0 where they are not seen.
HeightPrior heightByTangents(const Terms& terms, std::size_t v);

/// Weighted median; `values` is (value, weight), reordered.
double weightedMedian(std::vector<std::pair<double, double>>& values);

}  // namespace omnifleet::outline::detail
