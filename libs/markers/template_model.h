#pragma once

#include <Eigen/Core>
#include <vector>

#include "markers/layout.h"

namespace omnifleet::markers {

/// Share of each pixel that each region of a marker covers, and its derivatives. Region i is the visible part
/// of rectangle i in painter's order. Rows are pixels, columns are regions.
struct Coverage {
  Eigen::ArrayXXf value;
  Eigen::ArrayXXf du, dv;       ///< by the position of the pixel in base_link, 1/m
  Eigen::ArrayXXf d_log_sigma;  ///< by the logarithm of the blur
};

/// Blurred image of rectangles in painter's order. The visible part of a rectangle is the rectangle without
/// its intersections with later ones. An intersection is again a rectangle, so inclusion and exclusion give
/// the blurred coverage exactly, also where edges coincide: a sum of products of two blurred intervals.
/// The kernel of the blur is a quadratic B-spline, which is close to a Gaussian and needs no table.
class TemplateModel {
 public:
  explicit TemplateModel(const std::vector<Rectangle>& painted);

  Eigen::Index regions() const { return regions_; }
  /// Visible area of a region, m².
  double area(Eigen::Index region) const;
  /// Computes the first `count` rows. u, v: pixels in base_link, m. sigma_m: blur along x and y.
  void evaluate(const Eigen::ArrayXf& u, const Eigen::ArrayXf& v, Eigen::Index count,
                const Eigen::Vector2d& sigma_m, Coverage& coverage);

 private:
  /// Coordinates of edges along one axis, intervals between two of them, and their blurred values per pixel.
  struct Axis {
    std::vector<double> edges;
    std::vector<std::pair<std::size_t, std::size_t>> intervals;
    std::vector<Eigen::ArrayXf> step, slope, widening;     ///< per edge
    std::vector<Eigen::ArrayXf> value, d_place, d_spread;  ///< per interval

    std::size_t edge(double at);
    std::size_t interval(double low, double high);
    void evaluate(const Eigen::ArrayXf& place, Eigen::Index count, double sigma_m);
  };
  struct Term {
    Eigen::Index region;
    float sign;
    std::size_t x, y;  ///< intervals
  };

  Eigen::Index regions_;
  Axis x_, y_;
  std::vector<Term> terms_;
};

}  // namespace omnifleet::markers
