#pragma once

#include "ground/bit_mask.h"

namespace omnifleet::ground {

// What is done with masks, 256 pixels at a time, on the strips of an area; `out` is left alone beyond them.
// What lies beyond the image counts as 0. `in` and `out` are different masks of one size.

inline constexpr int kMaxReach = BitMask::kMargin;  ///< largest radius of the functions below

/// Set where all of the square of side 2·radius + 1 is.
void erode(const BitArea& area, int radius, const BitMask& in, BitMask& out);
/// Set where any of it is.
void dilate(const BitArea& area, int radius, const BitMask& in, BitMask& out);
/// A step of growth: dilate(1), where `within` is set. `within` may be `out`.
void growWithin(const BitArea& area, const BitMask& in, const BitMask& within, BitMask& out);
/// Median of 5×5: set where most of the 25 pixels are.
void takeMedian(const BitArea& area, const BitMask& in, BitMask& out);
/// The median and what touches it and was set before: a median rounds corners by a pixel.
void regrowCorners(const BitArea& area, const BitMask& before, const BitMask& median, BitMask& out);

}  // namespace omnifleet::ground
