#include "observation/sources.h"

namespace omnifleet {

const char* toString(Source source) {
  switch (source) {
    case Source::kWheels:
      return "wheels";
    case Source::kFloor:
      return "floor";
    case Source::kAppearance:
      return "appearance";
    case Source::kScan:
      return "scan";
    case Source::kLandmarks:
      return "landmarks";
    case Source::kSightings:
      return "sightings";
    case Source::kAbsolute:
      return "absolute";
    case Source::kInitialPose:
      return "initial_pose";
  }
  return "?";
}

}  // namespace omnifleet
