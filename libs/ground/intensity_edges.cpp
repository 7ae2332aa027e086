#include "ground/intensity_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr float kHighFactor = 1.25f;  // high threshold, as a multiple of the tolerance
constexpr float kLowShare =
    0.6f;  // low threshold, as a share of the high one; blocks above it join higher ones
constexpr float kTextureFactor = 2.0f;  // multiple of the floor's texture that is added to the tolerance
constexpr float kUnknown = std::numeric_limits<float>::infinity();
constexpr double kMinLength_m =
    0.7;  // minimum length across the view; objects of this size show other colours somewhere

}  // namespace

IntensityEdges::IntensityEdges(const lens::Camera& camera, const FloorView& view,
                               const RegionGrowing& growing, int block_cells)
    : floor_(camera, view, growing.means().size(), block_cells),
      darker_{floor_.marks(), {}},
      lighter_{floor_.marks(), {}} {
  for (int k = 0; k < kSectors; ++k) {
    const double bearing = ((k + 0.5) / kSectors - 0.5) * 2.0 * M_PI;
    for (int n = 1; n <= kReach; ++n)
      outward_[static_cast<std::size_t>(k)][static_cast<std::size_t>(n)] =
          growing.numberOf(cvRound(n * std::sin(bearing)), cvRound(n * std::cos(bearing))) -
          growing.numberOf(0, 0);
  }
  const cv::Mat1f& floor_m = floor_.floorM();
  for (int y = kReach; y < floor_m.rows - kReach; ++y)
    for (int x = kReach; x < floor_m.cols - kReach; ++x)
      if (floor_m(y, x) > 0.0f)
        blocks_.push_back({growing.numberOf(y, x), floor_.sectors()(y, x), floor_m(y, x)});
}

/// Relative change of the brightness from the block before `at` to the block `behind` steps beyond it, less
/// the gradient of the light on either side. 0 where it is unknown.
float IntensityEdges::stepAt(int at, const Outward& outward, int behind) const {
  const auto levelAt = [&](int blocks) {
    const int offset = outward[static_cast<std::size_t>(std::abs(blocks))];
    return levelOf(at + (blocks < 0 ? -offset : offset));
  };
  const auto slopeFrom = [&](int blocks, int towards) {
    int farther = kSlope;
    while (farther > 0 && levelAt(blocks + farther * towards) <= 0.0f) --farther;
    const float change = levelAt(blocks + farther * towards) / levelAt(blocks);
    return farther > 0 ? std::log(change) / static_cast<float>(farther * towards) : kUnknown;
  };
  const float before = slopeFrom(-1, -1), after = slopeFrom(behind, 1);
  if (before == kUnknown || after == kUnknown) return 0.0f;
  const auto steps = static_cast<float>(behind + 1);
  const float step = std::log(levelAt(behind) / levelAt(-1)), slope = steps * before,
              slope_behind = steps * after;
  return std::max(0.0f, step - std::max({0.0f, slope, slope_behind})) +
         std::min(0.0f, step - std::min({0.0f, slope, slope_behind}));
}

void IntensityEdges::mark(const RegionGrowing& growing, float tolerance) {
  const float low = kLowShare * tolerance;
  for (Side* side : {&darker_, &lighter_}) {
    side->marks = std::uint8_t{0};
    side->high_m.fill(0.0f);
  }
  for (const Block& block : blocks_) {
    const Outward& outward = outward_[block.sector];
    const auto levelAt = [&](int offset) { return levelOf(block.at + offset); };
    const float before = levelAt(-outward[1]);
    if (before <= 0.0f) continue;
    int behind = 1;
    while (behind <= kMostGap && levelAt(outward[static_cast<std::size_t>(behind)]) <= 0.0f) ++behind;
    const float level = levelAt(outward[static_cast<std::size_t>(behind)]);
    if (level <= 0.0f || std::abs(before - level) <= low * before) continue;
    const float step = stepAt(block.at, outward, behind);
    if (std::abs(step) <= low) continue;
    Side& side = step < 0.0f ? darker_ : lighter_;
    const bool is_high = std::abs(step) > tolerance;
    side.marks(growing.blockAt(block.at)) = is_high ? kHigh : kLow;
    float& farthest_m = side.high_m[block.sector];
    if (is_high) farthest_m = std::max(farthest_m, block.floor_m);
  }
}

bool IntensityEdges::isLong(const Lengths& high_m) {
  return FloorBlocks::lengthOf(high_m) >= kMinLength_m;
}

void IntensityEdges::keep(const Blob& region) {
  found_.push_back(pool_.take());
  enlarge(region, floor_.sizePx(), found_.back());
  found_.back().label = static_cast<int>(found_.size());
}

void IntensityEdges::find(const RegionGrowing& growing, float tolerance) {
  clear();
  growing.levels(levels_);  // the green channel suffices, because the hue is the floor's
  mark(growing, kHighFactor * tolerance + kTextureFactor * growing.texture());
  for (Side* side : {&darker_, &lighter_}) {
    if (!isLong(side->high_m)) continue;
    cv::morphologyEx(side->marks, side->marks, cv::MORPH_CLOSE, cv::Mat());
    for (const Blob& region : floor_.regions(side->marks))
      if (isLong(floor_.lengthsOf(region, side->marks, kHigh))) keep(region);
  }
}

}  // namespace omnifleet::ground
