#pragma once

#include <deque>
#include <vector>

#include "estimation/fleet_state.h"
#include "observation/observation.h"

namespace omnifleet::estimation {

/// Measurements wait here until the robots they speak of have frames at or after their times, then become
/// factors at the nearest frame, moved there by the robot's own motion.
class MeasurementQueue {
 public:
  void push(const Measurement& measurement) { waiting_.push_back(measurement); }

  /// Attaches what can be attached. `frames`: the samples of this time; an absolute pose locates a robot of
  /// them that is unlocated. Measurements more than 2 s older than `time` are dropped and counted.
  void attach(FleetState& fleet, TimeNs time, const std::vector<const Objects*>& frames);

 private:
  enum class Outcome { kWait, kDone, kRejected };
  Outcome attachOne(FleetState& fleet, const Measurement& measurement,
                    const std::vector<const Objects*>& frames);
  Outcome attachAbsolute(FleetState& fleet, const Measurement& measurement,
                         const std::vector<const Objects*>& frames);
  Outcome attachRelative(FleetState& fleet, const Measurement& measurement);
  Outcome attachToPoint(FleetState& fleet, const Measurement& measurement, RobotNode& robot,
                        const PoseAt& from);
  /// Ranges and bearings from or of a robot that has no pose yet tell where it may be; true when taken so.
  bool attachToScout(const FleetState& fleet, const Measurement& measurement, TimeNs from_ns, RobotNode& from,
                     RobotNode* to);

  std::deque<Measurement> waiting_;
};

}  // namespace omnifleet::estimation
