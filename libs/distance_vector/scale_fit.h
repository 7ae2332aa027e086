#pragma once

#include <optional>
#include <string>
#include <vector>

namespace omnifleet::distance_vector {

/// A distance seen by the robot's camera (pixels from the bottom of its image) and by the ceiling camera
/// (pixels): a row of Table 1 of Ahmed et al. 2013.
struct ScalePair {
  double robot_px = 0.0;
  double ceiling_px = 0.0;
  double alpha() const { return ceiling_px / robot_px; }
};

/// Eq. 1 as printed: α(d_r) = 4.4e−8 d⁴ − 7e−6 d³ + 0.00011 d² + 0.028 d + 0.0051. Empty outside of 62–121
/// px, the distances of Table 1. It lies 3.1–5.8 % below the table in every row.
std::optional<double> paperAlpha(double robot_px);
/// Table 1 of the paper.
const std::vector<ScalePair>& paperTable();

/// α(d_r) = d_c/d_r as a polynomial (eq. 1), by least squares over the pairs, with Legendre polynomials on
/// the interval of the pairs as the basis: powers of 62–121 have a condition number beyond 1e10. It refuses
/// distances outside of that interval, where a polynomial of degree 4 runs wild.
class ScaleFit {
 public:
  /// The paper's degree.
  static constexpr int kPaperDegree = 4;

  /// @param degree 0–8; empty: the degree (at most 4) with the smallest leave-one-out error
  /// Throws options::Error if the pairs are too few (degree + 2), equal, not positive or not finite.
  explicit ScaleFit(std::vector<ScalePair> pairs, std::optional<int> degree = std::nullopt);

  /// Reads "d_robot_px,d_ceiling_px" rows; a header and # comments are allowed. Throws options::Error that
  /// names file and line.
  static std::vector<ScalePair> readPairs(const std::string& csv_path);
  /// A file that toYaml() wrote. Throws options::Error.
  static ScaleFit load(const std::string& path);
  std::string toYaml() const;

  /// Empty outside of [minPx(), maxPx()].
  std::optional<double> alpha(double robot_px) const;
  /// Eq. 2: d_c = d_r·α(d_r), pixels of the ceiling camera. Empty likewise.
  std::optional<double> ceilingPx(double robot_px) const;
  /// d d_c/d d_r at a distance inside the interval.
  double ceilingSlope(double robot_px) const;

  double minPx() const { return min_px_; }
  double maxPx() const { return max_px_; }
  int degree() const { return static_cast<int>(coefficients_.size()) - 1; }
  const std::vector<ScalePair>& pairs() const { return pairs_; }
  /// α of the pair minus α of the fit, per pair.
  std::vector<double> residuals() const;
  /// RMS of the prediction of each pair from all others, in α.
  double leaveOneOutRms() const { return leave_one_out_; }
  /// RMS of the residuals, in α, with the fit's degrees of freedom removed.
  double sigma() const;
  /// Coefficients of d⁰, d¹, …, for comparison with eq. 1.
  std::vector<double> powers() const;

 private:
  double value(double robot_px) const;

  std::vector<ScalePair> pairs_;
  std::vector<double> coefficients_;  ///< of the Legendre polynomials
  double min_px_ = 0.0, max_px_ = 0.0, leave_one_out_ = 0.0;
};

}  // namespace omnifleet::distance_vector
