#include "ground/far_objects.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>

namespace omnifleet::ground {
namespace {

constexpr int kMost_px = 4000;         // larger regions never disappear completely
constexpr double kLeastThin_px = 3.5;  // thinner regions are noise at an edge
constexpr double kLeastLong_px = 12.0;
constexpr double kLeastWide_m = 0.35;  // markings and odd ends of objects are narrower
constexpr double kLongest_m = 0.7;     // tape is longer
constexpr double kLeastFilled = 0.9;   // share of the rectangle with the same moments

bool isRemoved(const Blob& region, const BitMask& bits) {
  return std::none_of(region.runs.begin(), region.runs.end(), [&](const Run& run) {
    for (int x = run.begin; x < run.end; ++x)
      if (bits.at(x, run.row)) return true;
    return false;
  });
}

/// Centroid and second central moments of the pixels of a region.
struct Moments {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero();
  Eigen::Matrix2d square = Eigen::Matrix2d::Zero();

  explicit Moments(const Blob& region) {
    for (const Run& run : region.runs) {
      const double n = run.end - run.begin, x = 0.5 * (run.begin + run.end - 1), y = run.row;
      middle += n * Eigen::Vector2d(x, y);
      const double own = n * (n * n - 1.0) / 12.0;
      square(0, 0) += n * x * x + own;
      square(0, 1) += n * x * y;
      square(1, 1) += n * y * y + n / 12.0;
    }
    const double area = region.area_px;
    middle /= area;
    square(1, 0) = square(0, 1);
    square = Eigen::Matrix2d(square / area - middle * middle.transpose());
  }
};

}  // namespace

bool FarObjects::isObject(const Blob& region) const {
  const Moments moments(region);
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> axes(moments.square);
  const Eigen::Vector2d size_px = (12.0 * axes.eigenvalues()).cwiseMax(0.0).cwiseSqrt();
  if (size_px(0) < kLeastThin_px || size_px(1) < kLeastLong_px ||
      region.area_px < kLeastFilled * size_px.prod())
    return false;
  const auto at = [&](const Eigen::Vector2d& offset) {
    return camera_.floorFromPixel(moments.middle + offset);
  };
  const Eigen::Vector2d across = axes.eigenvectors().col(0), along = axes.eigenvectors().col(1);
  const auto aside = at(0.5 * across), back = at(-0.5 * across), on = at(0.5 * along), off = at(-0.5 * along);
  if (!aside || !back || !on || !off) return false;
  // A region that reaches the horizon is a piece of a wall.
  const Eigen::Vector2d beyond = (0.5 * size_px(0) + 1.0) * across;
  if (!at(beyond) || !at(-beyond)) return false;
  // The width is measured along the axis that is short in the image, as the other axis may include the height
  // of the object.
  const double wide_m = size_px(0) * (*aside - *back).norm(), long_m = size_px(1) * (*on - *off).norm();
  return wide_m > kLeastWide_m && long_m < kLongest_m;
}

bool FarObjects::restore(const std::vector<Blob>& regions, BitMask& bits) const {
  bool any = false;
  for (const Blob& region : regions) {
    if (region.area_px > kMost_px || !isRemoved(region, bits) || !isObject(region)) continue;
    for (const Run& run : region.runs) bits.set(run.row, run.begin, run.end);
    any = true;
  }
  return any;
}

}  // namespace omnifleet::ground
