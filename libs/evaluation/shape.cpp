#include "evaluation/shape.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <stdexcept>

namespace omnifleet::evaluation {
namespace {

Eigen::Matrix2Xd centred(const std::vector<Eigen::Vector2d>& points) {
  Eigen::Matrix2Xd m(2, static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) m.col(static_cast<Eigen::Index>(i)) = points[i];
  const Eigen::Vector2d mean = m.rowwise().mean();
  m.colwise() -= mean;
  return m;
}

}  // namespace

double shapeDifference(const std::vector<Eigen::Vector2d>& a, const std::vector<Eigen::Vector2d>& c) {
  if (a.size() != c.size()) throw std::invalid_argument("shapeDifference: the point sets differ in length");
  if (a.size() < 2) return std::numeric_limits<double>::quiet_NaN();
  const Eigen::Matrix2Xd x = centred(a), y = centred(c);
  const double norms = x.squaredNorm() * y.squaredNorm();
  if (!(norms > 0.0)) return std::numeric_limits<double>::quiet_NaN();
  const Eigen::Matrix2d product = x * y.transpose();
  // (σ1 + σ2)² = σ1² + σ2² + 2 σ1 σ2 = ‖M‖² + 2 |det M|
  const double squared_sum = product.squaredNorm() + 2.0 * std::abs(product.determinant());
  return std::clamp(1.0 - squared_sum / norms, 0.0, 1.0);
}

}  // namespace omnifleet::evaluation
