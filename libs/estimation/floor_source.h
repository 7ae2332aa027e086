#pragma once

#include <Eigen/Core>
#include <optional>

#include "estimation/odometry_quality.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::estimation {

class FleetState;
struct RobotNode;
struct Step;

struct FloorSourceOptions {
  bool use = true;  ///< the texture of the floor measures motions
  OdometryQualityOptions quality;
  static FloorSourceOptions read(const options::Section& section);
};

/// The motion of one step by the texture of the floor, as claimed.
struct FloorStep {
  Pose2 previous_from_current;
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< right perturbation
};

/// Odometry of one robot by the texture of the floor (floor_motion of its frames). A reflection, a pattern
/// that repeats or a light that moves along may falsify it. So it counts only once scan matches, wheels or
/// landmarks have measured its errors, and with a covariance enlarged to explain these (OdometryQuality).
/// Before, it only predicts where a robot without wheels may be.
class FloorSource {
 public:
  explicit FloorSource(const FloorSourceOptions& options = {})
      : options_(options), quality_(options.quality) {}

  /// Notes in `step` what the floor says of it. It becomes the motion of the step if there are no wheels, or
  /// if it is confirmed and the wheels differ from it by more than `gate_chi2`: then they slip.
  /// @param wheels how good these are
  void predict(const FloorMotion& motion, const OdometryQuality& wheels, double gate_chi2, Step& step) const;
  /// Compares the newest step with what else measures it. Call it after the window is solved.
  void learn(const FleetState& fleet, const RobotNode& robot);
  /// Everything else contradicts a step by the floor.
  void reject() { ++rejected_; }

  bool isConfirmed() const { return quality_.isConfirmed() && quality_.areWaysConfirmed(); }
  const OdometryQuality& quality() const { return quality_; }
  int rejected() const { return rejected_; }  ///< steps

 private:
  FloorSourceOptions options_;
  OdometryQuality quality_;
  int rejected_ = 0;
};

}  // namespace omnifleet::estimation
