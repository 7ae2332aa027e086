#pragma once

#include <Eigen/Core>
#include <cstdint>

#include "geometry/pose2.h"
#include "observation/boundary.h"
#include "scan/line_scan.h"
#include "scan/scan_matcher.h"

namespace omnifleet::scan {

/// Tells whether two consecutive scans agree with a motion. Scans of a room show it whatever stands there, so
/// they decide where single objects seem to reject the measured motion.
class StepCheck {
 public:
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
  std::int64_t time_ns_ = 0;
  Boundary previous_;
  LineScan before_, now_;
  ScanMatcher matcher_;
};

}  // namespace omnifleet::scan
