#pragma once

#include "estimation/fleet_state.h"

namespace omnifleet::estimation {

/// Covariances of robots, landmarks and points after a solve, and by them what is believed and told of the
/// cameras. `whole`: that solve was of the whole window; `settled`: it was the last of the run.
void updateUncertainty(FleetState& fleet, bool whole, bool settled);

}  // namespace omnifleet::estimation
