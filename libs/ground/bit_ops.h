#pragma once

#include "ground/bit_mask.h"

namespace omnifleet::ground {

// Operations on masks, 256 pixels at a time, on the strips of an area. They do not change `out` outside the
// strips. Pixels outside the image count as 0. `in` and `out` are different masks of the same size.

inline constexpr int kMaxReach = BitMask::kMargin;  ///< largest radius of the functions below

/// Sets a pixel if the whole square of side 2·radius + 1 is set.
void erode(const BitArea& area, int radius, const BitMask& in, BitMask& out);
/// Sets a pixel if any pixel of the square of side 2·radius + 1 is set.
void dilate(const BitArea& area, int radius, const BitMask& in, BitMask& out);
/// One step of a constrained dilation: dilate(1), restricted to `within`. `within` may be `out`.
void growWithin(const BitArea& area, const BitMask& in, const BitMask& within, BitMask& out);
/// 5×5 median: sets a pixel if most of the 25 pixels are set.
void takeMedian(const BitArea& area, const BitMask& in, BitMask& out);
/// The median, plus the pixels that touch it and were set before. A median rounds corners by one pixel.
void regrowCorners(const BitArea& area, const BitMask& before, const BitMask& median, BitMask& out);

}  // namespace omnifleet::ground
