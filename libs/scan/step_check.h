#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "geometry/pose2.h"
#include "observation/boundary.h"
#include "options/options.h"
#include "scan/line_scan.h"
#include "scan/scan_matcher.h"

namespace omnifleet::scan {

struct StepCheckOptions {
  int min_lines = 60;        ///< beams with a line that both scans need
  double min_matched = 0.6;  ///< 1, share of the lines that must meet lines of the scan before
  double max_chi2 = 6.0;     ///< 1, mean squared residual of these, in σ²
  double agrees_chi2 = 9.0;  ///< χ² of the difference of match and motion, at most, that is an agreement
  double floor_m = 0.01;  ///< m, σ that is added to the motion: frames and wheels have different clocks; …
  double floor_rad = 0.01;  ///< rad, … of the turn
  double reach_m = 0.2;     ///< m, σ of the prior of the match beyond that of the motion, …
  double reach_rad = 0.1;   ///< rad, … of the turn
  static StepCheckOptions read(const options::Section& section);
};

/// Decides whether two consecutive scans agree with a motion. Scans of a room determine the motion whatever
/// stands there, so they decide where single objects seem to reject the measured one.
class StepCheck {
 public:
  explicit StepCheck(const StepCheckOptions& options = {}) : options_(options) {}

  enum class Verdict {
    kNothing,  ///< no scan is remembered, or they show too little
    kAgrees,   ///< both match within three σ of the motion
    kDiffers
  };

  /// Keeps the scan of a frame for the next one.
  void remember(std::int64_t time_ns, const Boundary& boundary);

  /// @param since_ns time of the frame before @param covariance of the motion, right perturbation
  Verdict judge(std::int64_t since_ns, const Pose2& previous_from_current, const Eigen::Matrix3d& covariance,
                const Boundary& boundary);

 private:
  StepCheckOptions options_;
  std::int64_t time_ns_ = 0;
  Boundary previous_;
  bool before_fitted_ = false;  ///< `before_` holds the lines of `previous_`
  LineScan before_, now_;
  ScanMatcher matcher_;
};

}  // namespace omnifleet::scan
