#pragma once

// Internal to libs/outline: rectangles and discs as simple models of several views.

#include <vector>

#include "outline/prism.h"

namespace omnifleet::outline::detail {

/// Support value of a view in one of its own directions: h_P(n) = a − h·q + n·t, t the shift of the view (see
/// fitPrism).
struct PlainSample {
  std::size_t view = 0;                              ///< index into PlainProblem::camera_height_m
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();  ///< map
  double a = 0.0, q = 0.0, sigma = 0.0;              ///< m, 1, m (of b)
};

struct PlainProblem {
  std::vector<PlainSample> samples;
  std::vector<double> camera_height_m;  ///< of each view
  double max_height_m = 0.0;
  HeightPrior prior;  ///< from another source; never from the tangents, which are part of the shape here
};

/// The usable directions of the views, evenly thinned to about 1000.
PlainProblem plainProblem(const std::vector<PrismView>& views, const std::vector<int>& chosen,
                          double max_height_m, const HeightPrior& prior);

struct PlainFit {
  bool valid = false;
  Polygon outline_m;  ///< map, counter-clockwise
  double height_m = 0.0, height_sigma_m = 0.0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< of the centre
  double size_sigma_m = 0.0;                                 ///< of the least certain half length
  double cost = 0.0;                                         ///< robust χ², as in costOfOutline
  int parameters = 0;
};

/// Fits a rectangle and a disc and returns the better one; each parameter costs `vertex_penalty`/2. The
/// height and the shifts of the views are estimated with the shape: Gauss–Newton with Cauchy weights, the
/// shifts eliminated view by view (Schur complement), from several initial orientations. A shape of five
/// numbers links both edges of a silhouette, so one view is enough to estimate its height; with a free
/// outline every height would fit.
PlainFit fitPlainShape(const PlainProblem& problem, const PrismOptions& options, double start_height_m);

/// Robust χ² of an outline at a height, with the best shifts of the views. It contains no penalty for the
/// number of parameters.
double costOfOutline(const PlainProblem& problem, const PrismOptions& options, const Polygon& outline_m,
                     double height_m);

}  // namespace omnifleet::outline::detail
