#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <vector>

#include "geometry/pose2.h"
#include "options/options.h"
#include "scan/line_scan.h"

namespace omnifleet::scan {

struct MatchOptions {
  double gate_m = 0.12;  ///< m, between a point and the line that it meets (plus 3 σ of the point)
  double first_gate_sigmas = 20.0;  ///< σ, largest residual in the first iteration, …
  double last_gate_sigmas = 5.0;    ///< … and in the last ones
  double robust_sigmas = 2.0;       ///< σ at which a residual counts half (Cauchy)
  double min_cosine = 0.85;         ///< 1, between the normals of two lines that may be one
  int iterations = 8;               ///< Gauss–Newton steps, at most
  int stride = 2;                   ///< every so many beams are used, of scans with many lines
  int min_beams = 30;               ///< fewer matched beams are no match
  static MatchOptions read(const options::Section& section);
};

/// Derivative of each beam's point by the parameters of its camera: point as measured minus true point, per
/// unit error of each parameter, axes of the scan. Empty: not known.
using BeamFields = std::vector<Eigen::Matrix<float, 2, 4>>;

/// What a match of two scans says about the errors of their cameras. r is the residual, x the pose, e the
/// errors of the camera of the scan (first four) and of the reference (last four).
struct CalibrationTerms {
  Eigen::Matrix<double, 3, 8> pose_by_error = Eigen::Matrix<double, 3, 8>::Zero();  ///< dx/de of the match
  /// Of e with the pose eliminated: information, and information · (optimum − value).
  Eigen::Matrix<double, 8, 8> information = Eigen::Matrix<double, 8, 8>::Zero();
  Eigen::Matrix<double, 8, 1> gradient = Eigen::Matrix<double, 8, 1>::Zero();
};

/// A scan to match against, at its pose. The scan is kept by reference.
struct Reference {
  const LineScan* scan = nullptr;
  Pose2 map_from_scan;
};

struct Match {
  bool valid = false;
  Pose2 map_from_scan;  ///< by the scan and the prior
  /// Of the scan alone, right perturbation: rank-deficient where the scene leaves a direction open (a
  /// corridor). Each of its principal directions is divided by the scatter of the gradient along it.
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  /// Where the scan alone would move the pose: information · (scan's optimum − map_from_scan).
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  /// Variance of the gradient as it scatters between sectors of the scan, relative to that of independent
  /// beams; at least 1. Errors of neighbouring beams go together: contact shadows, light, texture.
  double scatter = 1.0;
  double chi2 = 0.0;     ///< mean squared residual of the matched beams, in σ²
  double matched = 0.0;  ///< share of the scan's beams with a line that met a line of some reference
  int beams = 0;         ///< so many of them
};

/// Aligns a scan to others by Gauss–Newton, point to line in inverse range: each beam is predicted from the
/// nearest line of the reference, seen from the present pose. Information is that of one reference on
/// average: references share walls, and their own errors are not independent.
class ScanMatcher {
 public:
  explicit ScanMatcher(const MatchOptions& options = {}) : options_(options) {}

  /// @param start map_from_scan before @param prior information of `start`, right perturbation
  /// @param skip not 0: the beam takes no part; empty: all take part
  Match match(const LineScan& scan, const Pose2& start, const Eigen::Matrix3d& prior,
              const std::vector<Reference>& references, const std::vector<std::uint8_t>& skip = {});

  /// Dependence of a match with one reference on the errors of both cameras. @param map_from_scan as matched
  CalibrationTerms calibrationTerms(const LineScan& scan, const Pose2& map_from_scan,
                                    const Reference& reference, const BeamFields& of_scan,
                                    const BeamFields& of_reference) const;

 private:
  struct Sums;
  std::size_t stride(const LineScan& scan) const;
  template <typename Visit>
  void forEachPair(const LineScan& scan, const Reference& reference, const Pose2& pose, int reach,
                   double gate, const std::vector<std::uint8_t>& skip, Visit visit) const;
  void addReference(const LineScan& scan, const Reference& reference, const Pose2& pose, int reach,
                    double gate, const std::vector<std::uint8_t>& skip, Sums& sums);

  MatchOptions options_;
  std::vector<std::uint8_t> hit_;
  struct Sector {
    Eigen::Matrix3d h = Eigen::Matrix3d::Zero();
    Eigen::Vector3d g = Eigen::Vector3d::Zero();
    Eigen::Matrix3d derivative = Eigen::Matrix3d::Zero();  ///< of −g by the pose
  };
  struct Scatter {
    double mean = 1.0;                                     ///< over the directions of the pose, at least 1
    Eigen::Matrix3d weight = Eigen::Matrix3d::Identity();  ///< 1 / scatter of each principal direction
  };
  Scatter scatter(double per_reference) const;
  std::vector<Sector> sectors_;
};

}  // namespace omnifleet::scan
