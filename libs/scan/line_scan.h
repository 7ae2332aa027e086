#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "observation/boundary.h"

namespace omnifleet::scan {

/// A scan with a line fitted around each beam. In inverse range s = 1/r a line n·p = d is s = a·u, where
/// a = n/d and u is the unit vector of the bearing: a linear fit with nearly even noise.
class LineScan {
 public:
  struct Beam {
    float s = 0.0f;                                  ///< 1/m, as measured; 0: nothing
    float sigma = 0.0f;                              ///< 1/m, of s, scaled by the noise of the whole scan
    bool has_line = false;                           ///< a line fits around this beam and the beam lies on it
    Eigen::Vector2f line = Eigen::Vector2f::Zero();  ///< a = n/d, 1/m
    Eigen::Matrix2f line_covariance = Eigen::Matrix2f::Zero();  ///< of `line`
    Eigen::Vector2f point_m = Eigen::Vector2f::Zero();  ///< on the line, at this bearing, from the origin
  };

  /// Fits all beams. For each one the widest window of ±20, 10, 5, 3 or 2 beams (centred, or with the beam at
  /// one end) that a line explains with χ² per degree of freedom below 2. Beams without one (corners, depth
  /// jumps) take part in no match. Prefix sums make the cost independent of the windows.
  /// @param usable false: leave the beam out (it hits a robot); empty: all count
  /// @param bearing_sigma_rad rad, error of each bearing. On a line a·u it moves s by a·u′ per radian: far
  ///   beams at grazing angles are known less well than their ranges. 0: bearings are exact (cameras)
  void fit(const Boundary& boundary, const std::vector<bool>& usable = {}, double bearing_sigma_rad = 0.0);

  /// Information about the pose of the scan that its lines carry: that of a match against a noiseless copy of
  /// itself. Right perturbation. @param skip not 0: leave the beam out; empty: all count
  Eigen::Matrix3d information(const std::vector<std::uint8_t>& skip = {}) const;
  /// Releases the memory that only fit() needs, for scans that are kept.
  void compact();

  /// Bearings that measured something, in 64 sectors from bearing 0.
  std::uint64_t sectors() const;

  const std::vector<Beam>& beams() const { return beams_; }
  /// Unit vector of each bearing.
  const std::vector<Eigen::Vector2f>& bearings() const { return bearings_; }
  std::size_t lines() const { return lines_; }
  /// m, mean range of the beams with a line; 0: there are none.
  double meanRangeM() const { return mean_range_m_; }
  /// m, median of the σ of the ranges of the beams with a line.
  double medianSigmaM() const { return median_sigma_m_; }
  /// Ratio of the noise found in this scan (median of second differences) to the σ it came with.
  double noiseScale() const { return noise_scale_; }

 private:
  /// Sums over beams, weighted by 1/σ²: of u·uᵀ, u·s, s².
  struct Sums {
    double cc = 0, cs = 0, ss = 0, cy = 0, sy = 0, yy = 0;
    int n = 0;
    Sums operator-(const Sums& o) const {
      return {cc - o.cc, cs - o.cs, ss - o.ss, cy - o.cy, sy - o.sy, yy - o.yy, n - o.n};
    }
  };

  void prepareBearings(std::size_t count);
  void scaleNoise();
  void sumUp();
  Sums window(int from, int to) const;
  void fitBeam(int i);
  void addBearingError(std::size_t i, double sigma_rad);
  void summarise();

  std::vector<Beam> beams_;
  std::vector<Eigen::Vector2f> bearings_;
  std::vector<Sums> prefix_;  ///< over the circle and 2·kWidest beams on both sides of it
  std::vector<float> second_;
  double noise_scale_ = 1.0;
  double mean_range_m_ = 0.0, median_sigma_m_ = 0.0;
  std::size_t lines_ = 0;
};

}  // namespace omnifleet::scan
