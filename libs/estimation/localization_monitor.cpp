#include "estimation/localization_monitor.h"

namespace omnifleet::estimation {

LocalizationState LocalizationMonitor::update(const LocalizationEvidence& e) {
  const bool had_pose = state_ != LocalizationState::kUnlocated;
  const bool uncertain = e.sigma_m > options_.lost_m;
  unconfirmed_ = e.located && (e.confirmed || e.found) ? 0 : unconfirmed_ + 1;
  if (unconfirmed_ == 0)
    contradicted_ = 0;
  else if (e.contradicted)
    ++contradicted_;
  if (!e.located) {
    state_ = had_pose ? LocalizationState::kLost : LocalizationState::kUnlocated;
  } else if (e.found) {
    state_ = LocalizationState::kRelocalized;
  } else if (had_pose && !is_determined_ && e.confirmed && !uncertain) {
    state_ = LocalizationState::kRelocalized;
  } else if (!had_pose && uncertain) {
    state_ = LocalizationState::kOdometryOnly;
  } else if (!is_determined_ && uncertain && e.confirmed) {
    // Observations may agree with a pose that may be far off: the state stays.
  } else if (e.confirmed || !had_pose) {
    state_ = LocalizationState::kLocalized;
  } else if (state_ == LocalizationState::kRelocalized) {
    state_ = LocalizationState::kLocalized;
  } else if (state_ != LocalizationState::kLost && unconfirmed_ >= options_.patience) {
    state_ = !e.odometry && uncertain ? LocalizationState::kLost : LocalizationState::kOdometryOnly;
  }
  if (state_ == LocalizationState::kUnlocated || state_ == LocalizationState::kLost)
    is_determined_ = false;
  else if (!uncertain)
    is_determined_ = true;
  return state_;
}

}  // namespace omnifleet::estimation
