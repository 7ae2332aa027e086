#pragma once

#include "options/options.h"

namespace omnifleet::appearance {

enum class KeyframeRule {
  kEveryImage,
  kEveryNth,
  kDistance,   ///< travelled distance, from the wheels (set 1 of the paper: 10 cm)
  kDifference  ///< difference of the signatures (set 2 of the paper)
};

struct KeyframePolicy {
  KeyframeRule rule = KeyframeRule::kDifference;
  int every = 2;            ///< images
  double distance_m = 0.1;  ///< m
  double difference = 0.3;  ///< difference() of two signatures; about 0.3 at 5 to 10 cm in rooms
  /// Keys: rule (every_image, every_nth, distance, difference) and the names above.
  static KeyframePolicy read(const options::Section& section, const KeyframePolicy& defaults);
  static KeyframePolicy read(const options::Section& section) { return read(section, KeyframePolicy()); }

  /// @param images since the last keyframe, this one counted @param travelled_m, signature_difference since
  /// the last keyframe. The first image always is a keyframe; it is not asked for.
  bool isKeyframe(int images, double travelled_m, double signature_difference) const;
};

}  // namespace omnifleet::appearance
