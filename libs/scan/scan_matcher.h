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
  int stride = 2;                   ///< every so many beams are used
  int min_beams = 30;               ///< fewer matched beams are no match
  static MatchOptions read(const options::Section& section);
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
  /// corridor).
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  /// Where the scan alone would move the pose: information · (scan's optimum − map_from_scan).
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
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
  Match match(const LineScan& scan, const Pose2& start, const Eigen::Matrix3d& prior,
              const std::vector<Reference>& references);

 private:
  struct Sums;
  void addReference(const LineScan& scan, const Reference& reference, const Pose2& pose, int reach,
                    double gate, Sums& sums);

  MatchOptions options_;
  std::vector<std::uint8_t> hit_;
};

}  // namespace omnifleet::scan
