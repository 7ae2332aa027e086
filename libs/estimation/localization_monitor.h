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
  int patience = 5;     ///< frames without confirmation that change nothing yet
  double lost_m = 1.0;  ///< m, σ of a position that no odometry measures: beyond it a robot is lost, and a
                        ///< lost robot stays lost
};

/// State of one robot's localisation: localized → odometry_only → lost → relocalized. Only a robot without
/// any odometry is ever lost: it has none, or a localizer continues after a gap in which nothing was
/// measured.
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
};

}  // namespace omnifleet::estimation
