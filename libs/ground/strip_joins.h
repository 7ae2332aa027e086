#pragma once

#include <vector>

#include "ground/strip.h"

namespace omnifleet::ground {

inline constexpr int kMaxJoin = 8;  ///< largest radius of the functions below

/// out = largest of the square of side 2·radius + 1 around each pixel, on the strips; out is left alone
/// within `radius` of the image's edge. `in` and `out` are different masks of one size and step.
void largestAround(int radius, const std::vector<Strip>& strips, const cv::Mat1b& in, cv::Mat1b& out);
/// Likewise the smallest.
void smallestAround(int radius, const std::vector<Strip>& strips, const cv::Mat1b& in, cv::Mat1b& out);
/// A step of growth: largestAround(1), where `within` is 255, else 0. `within` may be `out`.
void growWithin(const std::vector<Strip>& strips, const cv::Mat1b& in, const cv::Mat1b& within,
                cv::Mat1b& out);

}  // namespace omnifleet::ground
