#pragma once

#include <chrono>
#include <string>

namespace omnifleet::bus {

/// How a run handles time. Live mode never waits and may drop samples. Replay (a recording at full speed) and
/// lockstep (the simulated arena) lose no sample; their services wait for each other.
enum class RunMode { kLive, kReplay, kLockstep };

/// True for modes in which no sample may be lost and the order must be reproducible.
inline bool isDeterministic(RunMode mode) {
  return mode != RunMode::kLive;
}
const char* toString(RunMode mode);

/// The part of the DDS QoS that the project sets per topic. Both ends of a topic use the same profile.
struct QosProfile {
  bool reliable = true;               ///< false: best effort, at both ends
  bool transient_local = false;       ///< late joiners receive the history
  bool keep_all = false;              ///< true: no sample is replaced; the writer waits for its readers
  int depth = 16;                     ///< keep the last `depth` samples per instance (ignored with keep_all)
  int max_instances = 64;             ///< keys (robots, sources, services) at one time
  int max_samples_per_instance = 64;  ///< bound of the history per key, at both ends
  bool data_sharing = false;          ///< frames only: such types carry no key
  bool off_host =
      true;  ///< read on other hosts: counted as traffic; false: only the robot's own host reads it
  bool while_outranked = false;  ///< written even while another process owns the same robot (Bus::rival)

  /// The total bound, which DDS requires besides the other two.
  int maxSamples() const { return max_instances * max_samples_per_instance; }
};

}  // namespace omnifleet::bus
