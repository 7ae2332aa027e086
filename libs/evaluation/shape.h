#pragma once

#include <Eigen/Core>
#include <vector>

namespace omnifleet::evaluation {

/// Procrustes shape difference of two point sets of equal length (Fernández et al. 2011, §IV): μ = 1 − (Σσ)²
/// / (‖A‖²‖C‖²). A and C are the centred points, σ the singular values of AᵀC. Invariant to scale, rotation,
/// translation and reflection. In [0, 1]; NaN for fewer than two points or if all points of a set coincide.
/// Throws std::invalid_argument for unequal lengths.
double shapeDifference(const std::vector<Eigen::Vector2d>& a, const std::vector<Eigen::Vector2d>& c);

}  // namespace omnifleet::evaluation
