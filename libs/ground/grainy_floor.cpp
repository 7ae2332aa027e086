#include "ground/grainy_floor.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr float kUnknown = -1.0f;
// Of the seeds' grain: their median, and what nine of ten stay below; of the brightness.
constexpr float kMedians = 3.0f, kTails = 1.2f, kLeastGrain = 0.03f;
constexpr int kWindow = 7;            // blocks
constexpr float kLeastKnown = 25.0f;  // blocks of a window
// Of these: grain all over, not lines; what is less coarse joins that, as at an edge windows hold both.
constexpr float kCoarse = 0.4f, kLessCoarse = 0.25f;
constexpr int kLeastBlocks = 40;
constexpr double kLeast_m = 0.7;               // long, seen from the camera
constexpr int kKnownBit = 1, kCoarseBit = 64;  // what counts in a window, side by side in one number

cv::Size wholeStrips(const cv::Size& size) {
  return {size.width, (size.height + kCell - 1) / kCell * kCell};
}

}  // namespace

GrainyFloor::GrainyFloor(const lens::Camera& camera, const FloorView& view, const FloorGrowth& growth,
                         int block_cells)
    : block_px_(block_cells * kCell),
      floor_m_(growth.means().size(), 0.0f),
      sectors_(floor_m_.size(), std::uint8_t{0}),
      greens_(floor_m_.size(), 0.0f),
      grain_(floor_m_.size(), kUnknown),
      counts_(floor_m_.size(), std::uint8_t{0}),
      sums_(floor_m_.size(), std::uint16_t{0}),
      marks_(wholeStrips(floor_m_.size()), std::uint8_t{0}),
      bits_(marks_.size()),
      area_(marks_.size()) {
  for (int row = 0; row * kCell < marks_.rows; ++row) all_.push_back({row, 0, marks_.cols});
  area_.cover(all_);
  rows_.resize(static_cast<std::size_t>(floor_m_.rows));
  const auto foot_px = camera.pixelFromPoint({camera.foot().x(), camera.foot().y(), 0.0});
  if (!foot_px) return;
  for (int y = 0; y < floor_m_.rows; ++y) {
    cv::Range& row = rows_[static_cast<std::size_t>(y)];
    for (int x = 0; x < floor_m_.cols; ++x) {
      const Eigen::Vector2d pixel = Eigen::Vector2d(x + 0.5, y + 0.5) * block_px_ - Eigen::Vector2d(0.5, 0.5);
      const auto floor = camera.floorFromPixel(pixel);
      if (!floor || view.coverage()(y * block_cells, x * block_cells) != 2) continue;
      const Eigen::Vector2d outward = pixel - *foot_px;
      const double turns = std::atan2(outward.y(), outward.x()) / (2.0 * M_PI) + 0.5;
      floor_m_(y, x) = static_cast<float>((*floor - camera.foot()).norm());
      sectors_(y, x) = static_cast<std::uint8_t>(std::min(kSectors - 1, static_cast<int>(turns * kSectors)));
      row = {row.empty() ? x : row.start, x + 1};
      if (view.seeds()(y * block_cells, x * block_cells) != 0) seeds_.emplace_back(x, y);
    }
  }
  sorted_.reserve(seeds_.size());
}

void GrainyFloor::readGrain(const cv::Mat3f& means, const BitMask& things) {
  const BitMask::Word pixels = (BitMask::Word{1} << block_px_) - 1;
  for (int y = 0; y < greens_.rows; ++y) {
    const cv::Range& range = rows_[static_cast<std::size_t>(y)];
    const float *mean = means.ptr<float>(y), *floor_m = floor_m_.ptr<float>(y);
    float* greens = greens_.ptr<float>(y);
    const BitMask::Word *top = things.row(y * block_px_), *bottom = things.row((y + 1) * block_px_ - 1);
    for (int x = range.start; x < range.end; ++x) {
      const int bit = x * block_px_;  // those of a block lie in one word
      const BitMask::Word word = top[bit / BitMask::kBits] | bottom[bit / BitMask::kBits];
      const bool is_floor = floor_m[x] > 0.0f && (word >> (bit % BitMask::kBits) & pixels) == 0;
      greens[x] = is_floor ? mean[3 * x + 1] : 0.0f;
    }
  }
  for (int y = 1; y + 1 < greens_.rows; ++y) {
    const float *above = greens_.ptr<float>(y - 1), *here = greens_.ptr<float>(y),
                *below = greens_.ptr<float>(y + 1);
    float* grain = grain_.ptr<float>(y);
    for (int x = 1; x + 1 < greens_.cols; ++x) {
      const float least = std::min({above[x], below[x], here[x - 1], here[x + 1], here[x]});
      const float across = std::abs(2.0f * here[x] - here[x - 1] - here[x + 1]),
                  along = std::abs(2.0f * here[x] - above[x] - below[x]);
      grain[x] = least > 0.0f ? std::min(across, along) : kUnknown;
    }
  }
}

/// What is coarser than that is no grain of the floor around the robot, as a share of the brightness; 0 where
/// that is not seen.
float GrainyFloor::seedsGrain(const FloorGrowth& growth) {
  sorted_.clear();
  level_ = 0.0f;
  for (const cv::Point& block : seeds_) {
    if (grain_(block) < 0.0f || !growth.isGrown(block.y, block.x)) continue;
    sorted_.push_back(grain_(block) / greens_(block));
    level_ += greens_(block);
  }
  constexpr std::size_t kFew = 20;
  if (sorted_.size() < kFew) return 0.0f;
  level_ /= static_cast<float>(sorted_.size());
  const auto at = [&](std::size_t n) {
    std::nth_element(sorted_.begin(), sorted_.begin() + static_cast<std::ptrdiff_t>(n), sorted_.end());
    return sorted_[n];
  };
  return std::max({kLeastGrain, kMedians * at(sorted_.size() / 2), kTails * at(sorted_.size() * 9 / 10)});
}

void GrainyFloor::mark(float coarse) {
  for (int y = 0; y < grain_.rows; ++y) {
    const float *grain = grain_.ptr<float>(y), *greens = greens_.ptr<float>(y);
    std::uint8_t* counts = counts_.ptr(y);
    // In the dark noise is no grain: it grows less than the light does.
    for (int x = 0; x < grain_.cols; ++x) {
      const bool is_known = grain[x] >= 0.0f, is_coarse = grain[x] > coarse * std::max(level_, greens[x]);
      counts[x] = static_cast<std::uint8_t>((is_known ? kKnownBit : 0) + (is_coarse ? kCoarseBit : 0));
    }
  }
  cv::boxFilter(counts_, sums_, CV_16U, {kWindow, kWindow}, {-1, -1}, false, cv::BORDER_CONSTANT);
  for (int y = 0; y < sums_.rows; ++y) {
    const std::uint16_t* sums = sums_.ptr<std::uint16_t>(y);
    const float* greens = greens_.ptr<float>(y);
    std::uint8_t* marks = marks_.ptr(y);
    for (int x = 0; x < sums_.cols; ++x) {
      const auto known = static_cast<float>(sums[x] % kCoarseBit),
                 coarse_ones = static_cast<float>(sums[x] / kCoarseBit);
      const bool is_marked = known >= kLeastKnown && greens[x] > 0.0f && coarse_ones > kLessCoarse * known;
      marks[x] = !is_marked ? 0 : coarse_ones > kCoarse * known ? kHigh : kLow;
    }
  }
}

bool GrainyFloor::isLarge(const Blob& region) const {
  std::array<float, kSectors> farthest_m{};
  int blocks = 0;
  for (const Run& run : region.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      if (marks_(run.row, x) != kHigh) continue;
      ++blocks;
      float& m = farthest_m[sectors_(run.row, x)];
      m = std::max(m, floor_m_(run.row, x));
    }
  }
  double length_m = 0.0;
  for (const float m : farthest_m) length_m += m * 2.0 * M_PI / kSectors;
  return blocks >= kLeastBlocks && length_m >= kLeast_m;
}

void GrainyFloor::keep(const Blob& region) {
  found_.push_back(pool_.take());
  enlarge(region, block_px_, found_.back());
  found_.back().label = static_cast<int>(found_.size());
}

void GrainyFloor::find(const FloorGrowth& growth, const BitMask& things) {
  clear();
  readGrain(growth.means(), things);
  const float coarse = seedsGrain(growth);
  if (coarse <= 0.0f) return;
  mark(coarse);
  bits_.clear();
  pack(all_, marks_, bits_);
  for (const Blob& region : labeller_.label(bits_, area_, 1))
    if (isLarge(region)) keep(region);
}

}  // namespace omnifleet::ground
