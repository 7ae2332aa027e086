#pragma once

#include <vector>

#include "ground/strip.h"

namespace omnifleet::ground {

enum class Along { kRows, kColumns };
inline constexpr int kMaxJoin = 8;  ///< largest radius of the functions below

/// out = largest of the 2·radius + 1 neighbours along rows or columns (each pixel's own included), on the
/// strips; out is left alone within `radius` of the image's edge. `in` and `out` are different masks.
void largestAlong(Along along, int radius, const std::vector<Strip>& strips, const cv::Mat1b& in,
                  cv::Mat1b& out);
/// Likewise the smallest.
void smallestAlong(Along along, int radius, const std::vector<Strip>& strips, const cv::Mat1b& in,
                   cv::Mat1b& out);

}  // namespace omnifleet::ground
