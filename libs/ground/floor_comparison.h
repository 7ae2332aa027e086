#pragma once

#include <Eigen/Core>
#include <cmath>
#include <cstddef>
#include <cstdint>
#include <opencv2/core.hpp>

#include "geometry/pose2.h"
#include "ground/floor_raster.h"

namespace omnifleet::ground {

/// Values and gradients of a reference raster in one block of FloorRaster::kBlock × kBlock cells. Of 2 × 2
/// cells, the first subset contains the upper left one and the second subset the lower right one.
struct FloorBlock {
  static constexpr int kLanes = 8, kRows = 8;  ///< of a subset
  static constexpr int kSubset = kLanes * kRows, kSubsets = 2;
  int x = 0, y = 0;
  int rows = 0;                                          ///< one bit per row of a subset that has values
  float value[kSubsets * kSubset];                       ///< FloorRaster::kNone where there is none
  float gx[kSubsets * kSubset], gy[kSubsets * kSubset];  ///< per cell; reduced where it is very steep
};

/// Sums over one block.
struct FloorBlockScore {
  float gradient[3], correlation;  ///< Σ w J r, Σ w I R
};

/// Largest magnitudes of values that are compared.
struct FloorLimits {
  float current, reference;
};

/// Raster position in the current frame of a raster position (x, y) in the reference:
/// (c·x + s·y + u, c·y − s·x + v).
struct FloorWarp {
  FloorWarp(const Pose2& pose, const Eigen::Vector2d& base) {
    const double cosine = std::cos(pose.theta_rad), sine = std::sin(pose.theta_rad), x = -base.x() - pose.x_m,
                 y = -base.y() - pose.y_m;
    c = static_cast<float>(cosine);
    s = static_cast<float>(sine);
    u = static_cast<float>(cosine * x + sine * y + base.x());
    v = static_cast<float>(cosine * y - sine * x + base.y());
  }
  float c = 1.0f, s = 0.0f, u = 0.0f, v = 0.0f;
};

/// The loops over the cells of an alignment (FloorAlignment): a raster I, moved by a pose, against the blocks
/// of a reference R.
class FloorComparison {
 public:
  /// @param reference_from_current in cells @param raster is kept by reference
  FloorComparison(const Pose2& reference_from_current, const FloorRaster& raster)
      : warp_(reference_from_current, raster.base()), raster_(raster) {}

  static constexpr int kTotals = 12;
  /// Gauss–Newton sums with Cauchy's weights w and their slopes w'.
  /// @param robust 1/k², where a residual k counts half
  /// @param totals Σ over all blocks: w' J J_curᵀ (xx, 2 xy, 2 xθ, yy, 2 yθ, θθ), w I², w R², w, number of
  /// cells, |r|, w I R
  void compare(const FloorBlock* blocks, std::size_t count, int subsets, float gain, float robust,
               FloorBlockScore* scores, float* totals) const;
  /// Σ I·R per block over the first subset, with the nearest cell.
  void correlate(const FloorBlock* blocks, std::size_t count, const FloorLimits& limits, float* sums) const;

  static constexpr int kShift = 4, kShiftSide = 2 * kShift + 1;  ///< coarse cells
  /// Σ of products of two coarse rasters for all shifts of the second by up to kShift, row by row.
  static void scoreShifts(const cv::Mat1f& reference, const cv::Mat1f& current, float* scores);

 private:
  FloorWarp warp_;
  const FloorRaster& raster_;
};

}  // namespace omnifleet::ground
