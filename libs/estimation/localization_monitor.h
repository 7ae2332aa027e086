#pragma once

#include "observation/observation.h"

namespace omnifleet::estimation {

/// Evidence of one frame about the localisation of a robot.
struct LocalizationEvidence {
  bool located = false;    ///< it has a pose
  bool odometry = false;   ///< its motion since the frame before was measured
  bool confirmed = false;  ///< scan, landmarks, other robots or an absolute measurement agree with the pose
  bool contradicted = false;  ///< what it observes contradicts the pose
  bool found = false;         ///< its place was found anew, by a unique match confirmed over travel
  double sigma_m = 0.0;       ///< of its position
};

struct LocalizationMonitorOptions {
  int patience = 5;  ///< frames without confirmation that change nothing yet
  /// m, σ of a position: beyond it a robot without odometry is lost, and a robot whose position was not known
  /// better since it was placed or lost is not localized, whatever agrees with its pose.
  double lost_m = 1.0;
};

/// State of one robot's localisation: localized → odometry_only → lost → relocalized. Only a robot without
/// any odometry is ever lost. A localizer may place a robot with a large σ, after a gap in which nothing
/// measured its motion: odometry_only → relocalized.
class LocalizationMonitor {
 public:
  explicit LocalizationMonitor(const LocalizationMonitorOptions& options = {}) : options_(options) {}

  LocalizationState update(const LocalizationEvidence& evidence);
  LocalizationState state() const { return state_; }
  /// Frames in a row without confirmation, …
  int unconfirmed() const { return unconfirmed_; }
  /// … and of them with a contradiction. So many that the pose may be wrong:
  int contradicted() const { return contradicted_; }
  /// From then on until something confirms the pose or finds another one.
  bool isInDoubt() const { return contradicted_ >= options_.patience; }
  int patience() const { return options_.patience; }

 private:
  LocalizationMonitorOptions options_;
  LocalizationState state_ = LocalizationState::kUnlocated;
  int unconfirmed_ = 0, contradicted_ = 0;
  bool is_determined_ = false;  ///< σ was at most lost_m since it was placed, or lost
};

}  // namespace omnifleet::estimation
