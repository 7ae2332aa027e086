#pragma once

#include <Eigen/Core>
#include <optional>

#include "geometry/pose2.h"
#include "options/options.h"

namespace omnifleet::estimation {

struct OdometryQualityOptions {
  double memory_steps = 30.0;  ///< steps that the moments reach back
  double prior_steps = 5.0;    ///< weight of the prior that the wheels are as good as they claim
  double most_m = 0.5;         ///< m; a larger correction is slip or a wrong match, not noise
  double most_rad = 0.5;       ///< rad, likewise
  double sharp_m = 0.02;       ///< m, σ of a match, at most, that measures errors of places, …
  double sharp_rad = 0.01;     ///< rad, … and of headings
  static OdometryQualityOptions read(const options::Section& section);
};

/// How good the wheel odometry of one robot is, estimated from the corrections of its steps by scan matches.
/// Errors of the path are independent from step to step. Jitter of the single frames (wheels and scans with
/// different clocks) enters two consecutive corrections with opposite signs, so the product of both separates
/// it (innovation-based adaptive estimation, Mehra 1970; docs/methods/localizer.md, "Jitter").
class OdometryQuality {
 public:
  explicit OdometryQuality(const OdometryQualityOptions& options = {}) : options_(options) {}

  /// @param correction of the predicted pose of a step @param of_match its covariance
  /// @param claimed covariance of the step by the wheels @param step_m its length
  void add(const Pose2& correction, const Eigen::Matrix3d& of_match, const Eigen::Matrix3d& claimed,
           double step_m);
  /// A step without wheels, or with rejected ones: the next correction has no predecessor.
  void interrupt();

  /// As many matches as the prior weighs have measured its turns.
  bool isConfirmed() const { return turn_.steps >= options_.prior_steps; }
  /// … and as many its ways, in all directions.
  bool areWaysConfirmed() const { return way_.steps >= options_.prior_steps; }
  double jitterM() const { return jitter_m_; }      ///< m, σ of a frame's place on the path of the wheels
  double jitterRad() const { return jitter_rad_; }  ///< rad, of its heading
  double wayScale() const { return way_scale_; }  ///< σ of the path, in units of what the wheels claim; ≥ 1
  double turnScale() const { return turn_scale_; }  ///< likewise of its turns
  /// Of a frame's pose on the path of the wheels, right perturbation.
  Eigen::Matrix3d jitter() const;
  /// Covariance of a step from what the wheels claim.
  Eigen::Matrix3d scaled(const Eigen::Matrix3d& claimed) const;

 private:
  /// Moments of the corrections, in metres per axis or in radians.
  struct Moments {
    double square = 0.0, product = 0.0;  ///< of one correction, of two consecutive ones
    double wheels = 0.0, matches = 0.0;  ///< variances that the wheels and the matches claim
    double steps = 0.0, pairs = 0.0;     ///< weights of the sums
    std::optional<Eigen::Vector2d> last;
  };
  void add(Moments& moments, const Eigen::Vector2d& correction, double wheels, double match) const;
  double jitterVariance(const Moments& moments) const;
  double scale(const Moments& moments) const;

  OdometryQualityOptions options_;
  Moments way_, turn_;
  double jitter_m_ = 0.0, jitter_rad_ = 0.0;
  double way_scale_ = 1.0, turn_scale_ = 1.0;
};

}  // namespace omnifleet::estimation
