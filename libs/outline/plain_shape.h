#pragma once

// Inside libs/outline: rectangles and discs as simple explanations of what several views show.

#include <vector>

#include "outline/prism.h"

namespace omnifleet::outline::detail {

/// A view's value in one of its own directions: h_P(n) = a − h·q + n·t, t the shift of the view (see
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
  HeightPrior prior;  ///< told from elsewhere; never from the tangents, which are part of the shape here
};

/// The usable directions of the views, evenly thinned to about a thousand.
PlainProblem plainProblem(const std::vector<PrismView>& views, const std::vector<int>& chosen,
                          double max_height_m, const HeightPrior& prior);

struct PlainFit {
  bool valid = false;
  Polygon outline_m;  ///< map, counter-clockwise
  double height_m = 0.0, height_sigma_m = 0.0;
  Eigen::Matrix2d covariance = Eigen::Matrix2d::Identity();  ///< of the centre
  double size_sigma_m = 0.0;                                 ///< of the worst known half length
  double cost = 0.0;                                         ///< robust χ², as costOfOutline tells it
  int parameters = 0;
};

/// The better of a rectangle and a disc (each costs `vertex_penalty`/2 per parameter), height and shifts of
/// the views estimated with it: Gauss–Newton with Cauchy weights, the shifts eliminated view by view (Schur
/// complement), from several turns. A shape of five numbers ties both edges of a silhouette together: its
/// height shows in one view alone, where a free outline would be as content with any.
PlainFit fitPlainShape(const PlainProblem& problem, const PrismOptions& options, double start_height_m);

/// Robust χ² that an outline leaves at a height, the shifts of the views at their best; a number of
/// parameters is not paid for here.
double costOfOutline(const PlainProblem& problem, const PrismOptions& options, const Polygon& outline_m,
                     double height_m);

}  // namespace omnifleet::outline::detail
