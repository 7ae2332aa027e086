#pragma once

#include <algorithm>
#include <cstdint>

namespace omnifleet::ground {

/// What a pixel that is not floor looks like beside the floor there, in one byte: 0 floor, 1 another hue than
/// the floor's, else the floor's hue at another brightness: 2 + 100 × brightness ÷ the floor's, at most 255.
using Look = std::uint8_t;
inline constexpr Look kFloorLook = 0, kColourLook = 1;
/// Least share of the floor's light that a shadow leaves.
inline constexpr float kDeepestShade = 0.40f;

/// Of the squared tolerance of hue: beyond it something has another hue than the floor in any light.
inline constexpr float kOtherHue = 2.0f;

inline constexpr Look greyLook(float gain) {
  return static_cast<Look>(2.0f + std::min(253.0f, 100.0f * gain));
}
inline bool isGrey(Look look) {
  return look > kColourLook;
}
inline float gainOf(Look look) {
  return 0.01f * (static_cast<float>(look) - 2.0f);
}
/// Brightness by which the floor's own pattern (tiles, worn places) differs from place to place, as a share.
inline constexpr float kFaintContrast = 0.17f;
/// The floor's hue at nearly its brightness: a pattern of the floor, or a thing of its colour.
inline bool isFaint(Look look) {
  return isGrey(look) && gainOf(look) > 1.0f - kFaintContrast && gainOf(look) < 1.0f + kFaintContrast;
}
/// The same on a floor that is known to have a pattern.
inline constexpr float kPatternContrast = 0.24f;
inline bool isOfPattern(Look look) {
  return isGrey(look) && gainOf(look) > 1.0f - kPatternContrast && gainOf(look) < 1.0f + kPatternContrast;
}
/// Shade that the lamp throws, however deep (LampShadows): as light as the deepest shade.
inline constexpr Look kLampShade = greyLook(kDeepestShade) + 1;
/// The floor in less light, for all that one pixel can tell.
/// @param deepest share of its light that is left in the deepest shadow
inline bool isShade(Look look, float deepest) {
  return isGrey(look) && gainOf(look) >= deepest && gainOf(look) < 1.0f;
}

}  // namespace omnifleet::ground
