#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>

#include "flow/pyramid.h"
#include "options/options.h"

namespace omnifleet::flow {

struct LucasKanadeOptions {
  int radius_px = 5;         ///< pixels: the window is (2·radius + 1)²; 2–10
  double sigma_px = 3.0;     ///< pixels: Gaussian weights ω of eq. 5; 0: equal weights (eq. 4)
  int levels = 3;            ///< pyramid levels, 1–6
  int iterations = 10;       ///< maximum per level
  double epsilon_px = 0.02;  ///< pixels: a smaller step ends the iteration of a level
  double min_eigenvalue =
      4.0;  ///< (grey levels per pixel)²: smaller eigenvalue of the weighted AᵀWA below which a point is lost
  double max_residual = 16.0;  ///< grey levels: weighted RMS difference above which a point is lost
  double max_return_px = 0.5;  ///< pixels: forward–backward error above which a point is lost
  static LucasKanadeOptions read(const options::Section& section);
};

/// Pyramidal Lucas–Kanade with Gaussian weights (Choi eq. 3–5): v = (AᵀWA)⁻¹AᵀWb, iterated, coarse to fine.
class LucasKanade {
 public:
  static constexpr int kMaxRadius = 10;
  static constexpr int kAllLevels = 100;

  explicit LucasKanade(const LucasKanadeOptions& options);

  /// Pixels around a point that tracking with so many pyramid levels reads.
  int reach_px(int levels) const { return (options_.radius_px + 2) << (levels - 1); }

  /// Tracks one point from one image into another. `to` contains the initial guess, then the result.
  /// @return false when the point is lost (leaves the image, no texture, no match)
  bool follow(const Pyramid& from_image, const Pyramid& to_image, const Eigen::Vector2f& from,
              Eigen::Vector2f& to, int top_level = kAllLevels);

  /// Tracks forward with follow(), then backward at full resolution. The point is also lost when it does not
  /// return to its origin.
  bool followBothWays(const Pyramid& from_image, const Pyramid& to_image, const Eigen::Vector2f& from,
                      Eigen::Vector2f& to);

 private:
  static constexpr int kMaxSide = 2 * kMaxRadius + 1;
  static constexpr int kMaxColumns =
      24;  ///< row length of a window, and of one with a margin, in whole vectors
  static constexpr int kEdgeStep = kMaxColumns + 8;
  using Patch = std::array<float, kMaxColumns*(kMaxSide + 2) + 8>;

  bool prepare(const cv::Mat1b& image, const Eigen::Vector2f& centre);
  bool iterate(const cv::Mat1b& image, Eigen::Vector2f& centre, float& residual);
  template <typename Use>
  bool withWindow(const cv::Mat1b& image, const Eigen::Vector2f& centre, int side, Use use);

  LucasKanadeOptions options_;
  int side_;
  Patch weight_{}, template_{}, gx_{}, gy_{}, wide_{};
  std::array<std::uint8_t, kEdgeStep*(kMaxSide + 3)> edge_{};  ///< copy of a window at the edge of the image
  float inverse_[3] = {0, 0, 0};                               // inverse of AᵀWA: xx, xy, yy
};

}  // namespace omnifleet::flow
