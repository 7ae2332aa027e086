#pragma once

#include <vector>

namespace omnifleet::appearance {

/// Gradient over the elevation times the elevation, as weights of a row and its neighbours. Zero in padded
/// rows.
struct RowGradient {
  std::vector<float> above, here, below;
};

/// Sums over the rows of one column. g: gradient over the bearing, t: change by parallax, r: residual.
struct ColumnSums {
  float gg, gt, tt, gr, tr, rr;
};

/// Moves columns: out column c = grey at c + shift[c] · sign, by interpolation with quintic polynomials
/// around the circle. @param shift columns
void moveColumns(const float* grey, int padded, int columns, const float* shift, float sign, float* out);

/// mean = (a + b)/2, difference = b − a.
void meanAndDifference(const float* a, const float* b, int count, float* mean, float* difference);

/// @param mean, difference [column · padded + row]; one more value must be readable before and after mean
/// @param per_rad columns per radian @param parallax p(b) per column @param sine, cosine of b − h per column
void sumColumns(const float* mean, const float* difference, int padded, int columns, float per_rad,
                const RowGradient& gradient, const float* parallax, const float* sine, const float* cosine,
                ColumnSums* sums);

/// Sum of weight[c] · u_i(c) u_j(c) over the columns. @param basis [column · 16 + j] @param out 16 × 16
void sumProducts(const float* basis, const float* weight, int columns, float* out);

}  // namespace omnifleet::appearance
