#pragma once

#include <map>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "fleet/fleet.h"
#include "observation/observation.h"

namespace omnifleet::services {

// What the estimator needs to know of a fleet.

/// All robots of the fleet with their bodies, lenses and initial poses. If nothing defines `map`, it is the
/// first base_link of the first located robot.
std::vector<estimation::RobotSetup> setups(const fleet::Fleet& fleet,
                                           const estimation::EstimatorOptions& options);

/// Robots that map before anything relates them to `map`, with their first pose in their own frame. Under
/// ceiling cameras or among surveyed landmarks a robot waits for these.
std::map<std::string, Pose2> ownFrames(const fleet::Fleet& fleet,
                                       const estimation::EstimatorOptions& options);

/// The positions of the surveyed landmarks in `map`, metres, as measurements.
std::vector<Measurement> surveyed(const fleet::Fleet& fleet);

}  // namespace omnifleet::services
