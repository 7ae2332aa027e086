#include "appearance/keyframe_policy.h"

#include <string>

namespace omnifleet::appearance {

KeyframePolicy KeyframePolicy::read(const options::Section& section, const KeyframePolicy& defaults) {
  KeyframePolicy p = defaults;
  std::string rule = p.rule == KeyframeRule::kEveryImage ? "every_image"
                     : p.rule == KeyframeRule::kEveryNth ? "every_nth"
                     : p.rule == KeyframeRule::kDistance ? "distance"
                                                         : "difference";
  section.read("rule", rule, {"every_image", "every_nth", "distance", "difference"});
  p.rule = rule == "every_image" ? KeyframeRule::kEveryImage
           : rule == "every_nth" ? KeyframeRule::kEveryNth
           : rule == "distance"  ? KeyframeRule::kDistance
                                 : KeyframeRule::kDifference;
  section.read("every", p.every, {1, 100000});
  section.read("distance_m", p.distance_m, options::kPositive);
  section.read("difference", p.difference, {0.001, 2.0});
  section.finish();
  return p;
}

bool KeyframePolicy::isKeyframe(int images, double travelled_m, double signature_difference) const {
  switch (rule) {
    case KeyframeRule::kEveryImage:
      return true;
    case KeyframeRule::kEveryNth:
      return images >= every;
    case KeyframeRule::kDistance:
      return travelled_m >= distance_m;
    case KeyframeRule::kDifference:
      break;
  }
  return signature_difference >= difference;
}

}  // namespace omnifleet::appearance
