#include "bus/qos.h"

namespace omnifleet::bus {

const char* toString(RunMode mode) {
  switch (mode) {
    case RunMode::kLive:
      return "live";
    case RunMode::kReplay:
      return "replay";
    case RunMode::kLockstep:
      return "lockstep";
  }
  return "?";
}

}  // namespace omnifleet::bus
