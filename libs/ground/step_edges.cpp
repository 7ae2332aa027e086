#include "ground/step_edges.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr float kSteps = 1.25f;    // of the tolerance …
constexpr float kLowSteps = 0.6f;  // … and of that: they join those that are higher
constexpr float kTextures = 2.0f;  // of the floor's texture, added to the tolerance
constexpr float kUnknown = std::numeric_limits<float>::infinity();
constexpr double kLeast_m = 0.7;  // long, seen from the camera: things have other colours somewhere

/// Strips are kCell rows high.
cv::Size wholeStrips(const cv::Size& size) {
  constexpr int kRows = FloorView::kCell;
  return {size.width, (size.height + kRows - 1) / kRows * kRows};
}

}  // namespace

StepEdges::StepEdges(const lens::Camera& camera, const FloorView& view, const FloorGrowth& growth,
                     int block_cells)
    : block_px_(block_cells * FloorView::kCell),
      floor_m_(growth.means().size(), 0.0f),
      sectors_(growth.means().size(), std::uint8_t{0}),
      darker_{cv::Mat1b(wholeStrips(floor_m_.size()), std::uint8_t{0}), {}},
      lighter_{darker_.marks.clone(), {}},
      bits_(darker_.marks.size()),
      area_(darker_.marks.size()) {
  for (int row = 0; row * FloorView::kCell < floor_m_.rows; ++row) all_.push_back({row, 0, floor_m_.cols});
  area_.cover(all_);
  const Eigen::Vector2d foot = camera.foot();
  const auto foot_px = camera.pixelFromPoint({foot.x(), foot.y(), 0.0});
  if (!foot_px) return;
  for (int k = 0; k < kSectors; ++k) {
    const double bearing = ((k + 0.5) / kSectors - 0.5) * 2.0 * M_PI;
    for (int n = 1; n <= kReach; ++n)
      outward_[static_cast<std::size_t>(k)][static_cast<std::size_t>(n)] =
          growth.numberOf(cvRound(n * std::sin(bearing)), cvRound(n * std::cos(bearing))) -
          growth.numberOf(0, 0);
  }
  for (int y = kReach; y < floor_m_.rows - kReach; ++y) {
    for (int x = kReach; x < floor_m_.cols - kReach; ++x) {
      const Eigen::Vector2d pixel = Eigen::Vector2d(x + 0.5, y + 0.5) * block_px_ - Eigen::Vector2d(0.5, 0.5);
      const auto floor = camera.floorFromPixel(pixel);
      if (!floor || view.coverage()(y * block_cells, x * block_cells) == 0) continue;
      const Eigen::Vector2d outward = pixel - *foot_px;
      const double turns = std::atan2(outward.y(), outward.x()) / (2.0 * M_PI) + 0.5;
      floor_m_(y, x) = static_cast<float>((*floor - foot).norm());
      sectors_(y, x) = static_cast<std::uint8_t>(std::min(kSectors - 1, static_cast<int>(turns * kSectors)));
      blocks_.push_back({growth.numberOf(y, x), sectors_(y, x), floor_m_(y, x)});
    }
  }
}

/// By what share the brightness changes from the block before `at` to one behind it, beyond the slope of the
/// light on either side. 0 where that is not known.
float StepEdges::stepAt(int at, const Outward& outward, int behind) const {
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

void StepEdges::mark(const FloorGrowth& growth, float tolerance) {
  const float low = kLowSteps * tolerance;
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
    side.marks(growth.blockAt(block.at)) = is_high ? kHigh : kLow;
    float& farthest_m = side.high_m[block.sector];
    if (is_high) farthest_m = std::max(farthest_m, block.floor_m);
  }
}

bool StepEdges::isLong(const Lengths& high_m) {
  double length_m = 0.0;
  for (const float m : high_m) length_m += m * 2.0 * M_PI / kSectors;
  return length_m >= kLeast_m;
}

StepEdges::Lengths StepEdges::highOf(const Blob& region, const cv::Mat1b& marks) const {
  Lengths high_m{};
  for (const Run& run : region.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      if (marks(run.row, x) != kHigh) continue;
      float& farthest_m = high_m[sectors_(run.row, x)];
      farthest_m = std::max(farthest_m, floor_m_(run.row, x));
    }
  }
  return high_m;
}

void StepEdges::keep(const Blob& region) {
  found_.push_back(pool_.take());
  enlarge(region, block_px_, found_.back());
  found_.back().label = static_cast<int>(found_.size());
}

void StepEdges::find(const FloorGrowth& growth, float tolerance) {
  clear();
  growth.levels(levels_);  // green stands for all: the hue is the floor's
  mark(growth, kSteps * tolerance + kTextures * growth.texture());
  for (Side* side : {&darker_, &lighter_}) {
    if (!isLong(side->high_m)) continue;
    cv::morphologyEx(side->marks, side->marks, cv::MORPH_CLOSE, cv::Mat());
    bits_.clear();
    pack(all_, side->marks, bits_);
    for (const Blob& region : labeller_.label(bits_, area_, 1))
      if (isLong(highOf(region, side->marks))) keep(region);
  }
}

}  // namespace omnifleet::ground
