#pragma once

#include <chrono>
#include <string>

namespace omnifleet::bus {

/// How a run treats time. Live never waits and may drop; replay (a recording, as fast as it goes) and
/// lockstep (the arena) lose nothing and wait for one another.
enum class RunMode { kLive, kReplay, kLockstep };

/// True where no sample may be lost and the order must be reproducible.
inline bool isDeterministic(RunMode mode) {
  return mode != RunMode::kLive;
}
const char* toString(RunMode mode);

/// The part of DDS QoS that the project decides per topic; both ends of a topic use the same profile.
struct QosProfile {
  bool reliable = true;          ///< false: best effort, at both ends
  bool transient_local = false;  ///< late joiners get the history
  bool keep_all = false;         ///< true: no sample is replaced; the writer waits for its readers instead
  int depth = 16;                ///< keep last this many per instance (ignored with keep_all)
  int max_instances = 64;        ///< keys (robots, sources, services) at one time
  int max_samples_per_instance = 64;  ///< bound of the history per key, both ends
  bool data_sharing = false;          ///< frames only: such types carry no key
  std::chrono::milliseconds liveliness_lease{
      0};  ///< > 0: automatic liveliness with this lease (elections only)

  /// The bound that DDS wants beside the other two.
  int maxSamples() const { return max_instances * max_samples_per_instance; }
};

}  // namespace omnifleet::bus
