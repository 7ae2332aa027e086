#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "appearance/parallax_kernel.h"
#include "options/options.h"

namespace omnifleet::appearance {

struct ParallaxOptions {
  int harmonics = 7;        ///< K: the inverse range over the bearing is a Fourier series up to K; 0 … 7
  double per_m = 0.1;       ///< 1/m: prior σ of each coefficient of the inverse range of what is seen
  double distance_m = 0.2;  ///< m: displacement that the prior assumes if none is given
  double outlier = 0.5;     ///< columns with so many times the mean residual count half
  int iterations = 4;       ///< Gauss–Newton steps per band, at most
  double converged_deg = 0.01;  ///< degrees: a smaller change of the turn ends the iteration of a band
  // σ of the turn, see docs/methods/appearance.md.
  double sigma_factor = 1.0;  ///< on the σ of the least squares
  double sigma_share =
      0.7;  ///< σ of the parallax that the series cannot follow, as a share of the fitted one
  double sigma_floor_deg = 0.03;  ///< degrees
  double mismatch = 0.15;         ///< 1 − match at which σ doubles
  double least_contrast = 2.0;    ///< grey levels per column of 256, rms: a sector with less has no contrast
  double fewest_sectors = 7.0;    ///< contrast in fewer of the 16 sectors increases σ, by the third power
  /// Keys: the names above.
  static ParallaxOptions read(const options::Section& section);
};

/// Least squares for the turn between two panoramas with a displacement between them. The brightness
/// difference of the two, both moved into the frame halfway, is gradient × shift. The shift at bearing b is
///   s(b) = φ + p(b) sin(b − h),   p(b) = Σ_{k ≤ K} (α_k cos kb + β_k sin kb),
/// φ the turn, h the direction of travel, −p the displacement divided by the range of what is seen at b. What
/// is seen at elevation e also moves vertically, by e p(b) cos(b − h).
class ParallaxFit {
 public:
  static constexpr int kBands = 3;
  static constexpr std::array<int, kBands> kFrequencies{12, 24, 64};  ///< upper limits of the bands
  static constexpr std::array<int, kBands> kColumns{64, 128, 256};
  static constexpr int kSectors = 16;

  /// Band-limited rows of a panorama, each band divided by the norm of the widest one. Rows are padded to a
  /// multiple of 8 by zeros and stored column by column.
  struct View {
    int rows = 0, padded = 0;
    double norm = 0.0;                              ///< of the widest band, grey levels
    std::array<std::vector<float>, kBands> grey;    ///< [column · padded + row]
    std::array<std::vector<float>, kBands> weight;  ///< per column 0 or 1
  };

  /// Elevations of the edges of the band, radians.
  struct Band {
    double least_rad, most_rad;
  };

  struct Result {
    bool valid = false;
    double turn_rad = 0.0, sigma_rad = 0.0;
    double match = 0.0;            ///< mean correlation of the sectors, weighted by their contrast; 0 … 1
    double parallax_rad = 0.0;     ///< rms of p(b) sin(b − h)
    double turn_by_bearing = 0.0;  ///< change of the turn by a change of h, rad/rad
    int sectors = 0;               ///< number of the kSectors sectors that have contrast
  };

  explicit ParallaxFit(const ParallaxOptions& options);

  /// @param spectrum rows × frequencies, see Signature @param weight per column of the panorama
  void prepare(const Eigen::ArrayXXcf& spectrum, const Eigen::ArrayXf& weight, View& view) const;

  /// @param turn_rad initial value @param bearing_rad h @param distance_m displacement; negative: unknown
  Result solve(const View& from, const View& to, double turn_rad, double bearing_rad, double distance_m,
               const Band& elevations);

 private:
  static constexpr int kParameters = 16;  ///< at most: φ, α_0 … α_K, β_1 … β_K
  using Vector = Eigen::Matrix<double, kParameters, 1>;
  using Matrix = Eigen::Matrix<double, kParameters, kParameters>;

  void shape(const View& view, double bearing_rad, const Band& elevations);
  void warp(const View& from, const View& to, int band);
  void weigh(const View& from, const View& to, int band);
  double step(int band, double prior_sigma);
  double matchOfSectors() const;
  double parallax(int band) const;
  double turnBy(int column, double residual_gg, double residual_gt) const;
  double sensitivity() const;
  double turnByBearing() const;
  int sectorsWithContrast(double norm) const;

  ParallaxOptions options_;
  int parameters_;
  Vector state_;
  Matrix inverse_;         ///< of the last normal equations
  double variance_ = 0.0;  ///< of the residuals
  double bearing_rad_ = 0.0;
  int rows_ = 0;
  RowGradient gradient_;
  std::array<std::vector<float>, kBands> basis_;  ///< [column · 16 + j] of p(b)
  std::vector<float> shift_, parallax_, sine_, cosine_, weight_, information_;  ///< per column
  std::vector<float> a_, b_, mean_, difference_;                                ///< [column · padded + row]
  std::vector<ColumnSums> sums_;
};

}  // namespace omnifleet::appearance
