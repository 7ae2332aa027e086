#include "common/inlet.h"

namespace omnifleet::services {

bus::StreamMode streamMode(const bus::ServiceOptions& options) {
  return bus::isDeterministic(options.mode) ? bus::StreamMode::kLockstep : bus::StreamMode::kLive;
}

adapters::RunClock runClock(const bus::ServiceOptions& options) {
  switch (options.mode) {
    case bus::RunMode::kReplay:
      return adapters::RunClock::kDataset;
    case bus::RunMode::kLockstep:
      return adapters::RunClock::kSim;
    case bus::RunMode::kLive:
      break;
  }
  return adapters::RunClock::kSystem;
}

adapters::RunClock runClock(const bus::ServiceOptions& options, const fleet::Fleet& fleet) {
  if (fleet.arena) return adapters::RunClock::kSim;
  if (!fleet.dataset.empty()) return adapters::RunClock::kDataset;
  return runClock(options);
}

}  // namespace omnifleet::services
