#pragma once

// Internal to libs/outline: the prism's equation per view and direction, shared by the fits.

#include <vector>

#include "outline/prism.h"

namespace omnifleet::outline::detail {

/// h_P(n) = a − h·b per view and direction (see fitPrism), with a = n·c + b(n), b = PrismView::perHeight()
/// and sigma the σ of b(n); σ ≤ 0: unusable.
struct Term {
  double a = 0.0, b = 0.0, sigma = 0.0;
};

struct Terms {
  int directions = 0;
  std::vector<Eigen::Vector2d> normals;  ///< map
  std::vector<int> view;                 ///< index into the given views
  std::vector<double> camera_height_m;
  std::vector<Term> term;  ///< [view][direction]
  bool top_faces_only =
      false;  ///< true if any view has top_face_only: the tangents to the top's projection are not visible

  std::size_t views() const { return view.size(); }
  const Term& at(std::size_t v, int k) const {
    return term[v * static_cast<std::size_t>(directions) + static_cast<std::size_t>(k)];
  }
  /// σ of h_P(n) at height h: the far side is scaled down by 1/s.
  double sigmaAt(std::size_t v, int k, double height_m, double noise_m) const;
};

/// Height of the lowest camera; 0 if all views are from lasers.
double lowestCamera(const Terms& terms);

/// Terms of all views. Views without supports, without height or with a non-finite pose are omitted.
Terms termsOf(const std::vector<PrismView>& views, int directions, double noise_m);

/// If there are more than `count` views, keeps the most informative ones, taken in turn from 24 sectors
/// around the object.
Terms mostInformative(const Terms& terms, const std::vector<PrismView>& views, std::size_t count);

/// Widest gap between directions whose σ > 0, radians (2π when none).
double widestGap(const std::vector<DirectionEvidence>& evidence);

/// Convex polygon whose support function is closest to the evidence (about the origin of map).
Polygon polygonOf(const std::vector<DirectionEvidence>& evidence);

/// Support function of a polygon in a direction.
double supportOf(const Polygon& polygon, const Eigen::Vector2d& normal);

/// Height from the tangents of one view; σ ≤ 0 if they are not visible.
HeightPrior heightByTangents(const Terms& terms, std::size_t v);

/// Weighted median; `values` is (value, weight), reordered.
double weightedMedian(std::vector<std::pair<double, double>>& values);

}  // namespace omnifleet::outline::detail
