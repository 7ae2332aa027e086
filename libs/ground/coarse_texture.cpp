#include "ground/coarse_texture.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

// Factors for the median and the 90th percentile of the seeds' texture, and the minimum threshold; shares of
// the brightness.
constexpr float kMedians = 3.0f, kTails = 1.2f, kLeastTexture = 0.03f;
constexpr int kWindow = 7;       // blocks
constexpr int kLeastKnown = 25;  // minimum number of known blocks in a window
// Percent of the known blocks in a window. kCoarse is exceeded by a textured surface, not by single lines.
// Windows above kLessCoarse join such a region, because windows at its edge hold both surfaces.
constexpr int kCoarse = 40, kLessCoarse = 25;
constexpr int kLeastBlocks = 40;
constexpr double kLeast_m = 0.7;               // minimum extent as seen from the camera
constexpr int kKnownBit = 1, kCoarseBit = 64;  // two counters of a window in one number

/// Texture of the middle block of three rows: the smaller of its second differences along and across.
/// Negative if a block is 0 (unknown).
OMNIFLEET_INLINE float textureAt(const float* above, const float* here, const float* below) {
  const float least = std::min(std::min(*above, *below), std::min(std::min(here[-1], here[1]), *here));
  const float across = std::abs(2.0f * *here - here[-1] - here[1]),
              along = std::abs(2.0f * *here - *above - *below);
  return least > 0.0f ? std::min(across, along) : -1.0f;
}

/// Sets kKnownBit and kCoarseBit of n blocks.
OMNIFLEET_WIDE void countTexture(const float* __restrict above, const float* __restrict here,
                                 const float* __restrict below, int n, float coarse, float level,
                                 std::uint8_t* __restrict counts) {
  for (int x = 0; x < n; ++x) {
    const float texture = textureAt(above + x, here + x, below + x);
    // The threshold does not fall below the seeds' level in the dark, because noise decreases less than the
    // light does.
    const int known = texture >= 0.0f ? kKnownBit : 0,
              coarse_one = texture > coarse * std::max(level, here[x]) ? kCoarseBit : 0;
    counts[x] = static_cast<std::uint8_t>(known | coarse_one);
  }
}

OMNIFLEET_WIDE void markCoarse(const std::uint16_t* __restrict sums, const float* __restrict greens, int n,
                               int low, int high, std::uint8_t* __restrict marks) {
  for (int x = 0; x < n; ++x) {
    const int known = sums[x] % kCoarseBit, coarse = 100 * (sums[x] / kCoarseBit);
    const int mark = coarse > kCoarse * known ? high : coarse > kLessCoarse * known ? low : 0;
    const int is_known = (known >= kLeastKnown ? 255 : 0) & (greens[x] > 0.0f ? 255 : 0);
    marks[x] = static_cast<std::uint8_t>(mark & is_known);
  }
}

}  // namespace

CoarseTexture::CoarseTexture(const lens::Camera& camera, const FloorView& view, const RegionGrowing& growing,
                             int block_cells)
    : floor_(camera, view, growing.means().size(), block_cells),
      rows_(static_cast<std::size_t>(floor_.size().height)),
      greens_(floor_.size(), 0.0f),
      counts_(floor_.size(), std::uint8_t{0}),
      sums_(floor_.size(), std::uint16_t{0}),
      marks_(floor_.marks()) {
  for (int y = 0; y < floor_.size().height; ++y) {
    cv::Range& row = rows_[static_cast<std::size_t>(y)];
    for (int x = 0; x < floor_.size().width; ++x) {
      if (floor_.floorM()(y, x) <= 0.0f) continue;
      row = {row.empty() ? x : row.start, x + 1};
      const bool is_inside =
          cv::Rect(1, 1, floor_.size().width - 2, floor_.size().height - 2).contains({x, y});
      if (is_inside && view.seeds()(y * block_cells, x * block_cells) != 0) seeds_.emplace_back(x, y);
    }
  }
  sorted_.reserve(seeds_.size());
}

/// Reads the green means in the actual light. Evening out the illumination would amplify the noise in the
/// dark.
void CoarseTexture::readGreens(const RegionGrowing& growing, const BitMask& objects) {
  const int block_px = floor_.sizePx();
  const BitMask::Word pixels = (BitMask::Word{1} << block_px) - 1;
  for (int y = 0; y < greens_.rows; ++y) {
    const cv::Range& range = rows_[static_cast<std::size_t>(y)];
    const float *mean = growing.means().ptr<float>(y), *floor_m = floor_.floorM().ptr<float>(y);
    float* greens = greens_.ptr<float>(y);
    const BitMask::Word *top = objects.row(y * block_px), *bottom = objects.row((y + 1) * block_px - 1);
    for (int x = range.start; x < range.end; ++x) {
      const int bit = x * block_px;  // the bits of a block lie in one word
      const BitMask::Word word = top[bit / BitMask::kBits] | bottom[bit / BitMask::kBits];
      const bool is_floor = floor_m[x] > 0.0f && (word >> (bit % BitMask::kBits) & pixels) == 0;
      greens[x] = is_floor ? mean[3 * x + 1] : 0.0f;
    }
    if (!growing.isEvened()) continue;
    for (int x = range.start; x < range.end; ++x) greens[x] *= growing.lightAt(growing.numberOf(y, x));
  }
}

/// Threshold above which texture does not belong to the floor around the robot, as a share of the brightness.
/// 0 if too few seeds are visible.
float CoarseTexture::seedTexture(const RegionGrowing& growing) {
  const int width = greens_.cols;
  sorted_.clear();
  level_ = 0.0f;
  for (const cv::Point& block : seeds_) {
    if (!growing.isGrown(block.y, block.x)) continue;
    const float *here = greens_.ptr<float>(block.y) + block.x,
                texture = textureAt(here - width, here, here + width);
    if (texture < 0.0f) continue;
    sorted_.push_back(texture / *here);
    level_ += *here;
  }
  constexpr std::size_t kFew = 20;
  if (sorted_.size() < kFew) return 0.0f;
  level_ /= static_cast<float>(sorted_.size());
  const auto at = [&](std::size_t n) {
    std::nth_element(sorted_.begin(), sorted_.begin() + static_cast<std::ptrdiff_t>(n), sorted_.end());
    return sorted_[n];
  };
  return std::max({kLeastTexture, kMedians * at(sorted_.size() / 2), kTails * at(sorted_.size() * 9 / 10)});
}

void CoarseTexture::mark(float coarse) {
  const int width = greens_.cols;
  for (int y = 1; y + 1 < greens_.rows; ++y) {
    const float* here = greens_.ptr<float>(y) + 1;
    countTexture(here - width, here, here + width, width - 2, coarse, level_, counts_.ptr(y) + 1);
  }
  cv::boxFilter(counts_, sums_, CV_16U, {kWindow, kWindow}, {-1, -1}, false, cv::BORDER_CONSTANT);
  for (int y = 0; y < sums_.rows; ++y)
    markCoarse(sums_.ptr<std::uint16_t>(y), greens_.ptr<float>(y), width, kLow, kHigh, marks_.ptr(y));
}

bool CoarseTexture::isLarge(const Blob& region) const {
  int blocks = 0;
  for (const Run& run : region.runs)
    blocks +=
        static_cast<int>(std::count(marks_.ptr(run.row) + run.begin, marks_.ptr(run.row) + run.end, kHigh));
  return blocks >= kLeastBlocks && FloorBlocks::lengthOf(floor_.lengthsOf(region, marks_, kHigh)) >= kLeast_m;
}

void CoarseTexture::keep(const Blob& region) {
  found_.push_back(pool_.take());
  enlarge(region, floor_.sizePx(), found_.back());
  found_.back().label = static_cast<int>(found_.size());
}

void CoarseTexture::find(const RegionGrowing& growing, const BitMask& objects) {
  clear();
  readGreens(growing, objects);
  const float coarse = seedTexture(growing);
  if (coarse <= 0.0f) return;
  mark(coarse);
  for (const Blob& region : floor_.regions(marks_))
    if (isLarge(region)) keep(region);
}

}  // namespace omnifleet::ground
