#pragma once

#include <algorithm>
#include <cstdint>

namespace omnifleet::ground {

/// Appearance class of a pixel relative to the floor at that place, in one byte. 0: floor. 1: another hue
/// than the floor. Otherwise the floor's hue at another brightness: 2 + 100 × brightness / floor brightness,
/// at most 255.
using Appearance = std::uint8_t;
inline constexpr Appearance kFloorAppearance = 0, kColourAppearance = 1;
/// Minimum share of the floor's brightness that remains in a shadow.
inline constexpr float kDeepestShadow = 0.40f;

/// Multiple of the squared hue tolerance. A pixel beyond it has another hue than the floor in any light.
inline constexpr float kOtherHue = 2.0f;

inline constexpr Appearance greyAppearance(float gain) {
  return static_cast<Appearance>(2.0f + std::min(253.0f, 100.0f * gain));
}
inline bool isGrey(Appearance appearance) {
  return appearance > kColourAppearance;
}
inline float gainOf(Appearance appearance) {
  return 0.01f * (static_cast<float>(appearance) - 2.0f);
}
/// Brightness variation of the floor's own pattern (tiles, worn places), as a share of the brightness.
inline constexpr float kFaintContrast = 0.17f;
/// True if the pixel has the floor's hue at nearly its brightness. It is then a pattern of the floor or an
/// object of the floor's colour.
inline bool isFaint(Appearance appearance) {
  return isGrey(appearance) && gainOf(appearance) > 1.0f - kFaintContrast &&
         gainOf(appearance) < 1.0f + kFaintContrast;
}
/// Larger limits of isFaint() for a floor that is known to have a pattern.
inline constexpr float kPatternContrast = 0.24f;
inline bool isOfPattern(Appearance appearance) {
  return isGrey(appearance) && gainOf(appearance) > 1.0f - kPatternContrast &&
         gainOf(appearance) < 1.0f + kPatternContrast;
}
/// Appearance of a lamp's shadow at any depth (LampShadows). Its value is just above that of the deepest
/// shadow.
inline constexpr Appearance kLampShadow = greyAppearance(kDeepestShadow) + 1;
/// True if the single pixel is compatible with floor in less light.
/// @param deepest share of the floor's brightness that remains in the deepest shadow
inline bool isShadow(Appearance appearance, float deepest) {
  return isGrey(appearance) && gainOf(appearance) >= deepest && gainOf(appearance) < 1.0f;
}

}  // namespace omnifleet::ground
