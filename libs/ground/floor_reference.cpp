#include "ground/floor_reference.h"

#include <algorithm>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

// Frames until light that is even, or no lamp's, is looked at again, unless floor gets lost; twice as many
// each time that it still is, up to the latter: a look takes as long as a fifth of a frame's whole work.
constexpr int kEvenLight = 10, kRarely = 160;
constexpr double kMoreFloor = 1.01;  // what the light of a lamp must bring to be believed
// Of the most of the last frames, which fades by this share a frame: it may be believed no more.
constexpr double kLostFloor = 0.95, kFades = 0.01;
// Floor with less than so much of the light at the foot makes a lamp matter; once it does, with so much.
constexpr double kMatters = 0.65, kStillMatters = 0.75;
constexpr double kOtherLight = 0.03;  // of the brightness
constexpr int kLooks = 3;             // each from more floor than the last
constexpr int kLargeImage_px = 900;   // from this width on the model is made of blocks of 2×2 cells
/// Means of n blocks of 2×2 cells, three numbers each.
OMNIFLEET_WIDE void averageFours(const float* above, const float* below, int n, float* means) {
  using lanes::FourFloats;
  const auto meanAt = [above, below](int x) {
    const auto at = [x](const float* row, int cell) {
      return lanes::load<FourFloats>(row + 6 * x + 3 * cell);
    };
    return 0.25f * (at(above, 0) + at(above, 1) + at(below, 0) + at(below, 1));
  };
  // A mean is stored with a number too many, which the next one overwrites.
  for (int x = 0; x < n - 1; ++x) lanes::store(meanAt(x), means + 3 * x);
  for (int i = 3 * (n - 1); i < 3 * n; ++i) {
    const int first = 2 * i - i % 3;
    means[i] = 0.25f * (above[first] + above[first + 3] + below[first] + below[first + 3]);
  }
}

/// The least of each block × block cells, one value a whole block.
cv::Mat1b leastOf(const cv::Mat1b& cells, int block) {
  cv::Mat1b least(cells.rows / block, cells.cols / block, std::uint8_t{255});
  for (int y = 0; y < least.rows * block; ++y)
    for (int x = 0; x < least.cols * block; ++x)
      least(y / block, x / block) = std::min(least(y / block, x / block), cells(y, x));
  return least;
}

}  // namespace

ReferenceOptions ReferenceOptions::read(const options::Section& section) {
  ReferenceOptions o;
  section.read("tolerance_along", o.tolerance_along, {0.005, 0.9});
  section.read("tolerance_across", o.tolerance_across, {0.002, 0.9});
  section.read("noise_sigmas", o.noise_sigmas, {0.0, 20.0});
  section.read("min_share", o.min_share, {0.0, 0.5});
  section.read("smoothing_cells", o.smoothing_cells, {1, 40});
  section.finish();
  return o;
}

FloorReference::FloorReference(const lens::Camera& camera, const FloorView& view,
                               const ReferenceOptions& options)
    : options_(options),
      tolerance_{options.tolerance_along, options.tolerance_across, options.noise_sigmas},
      block_(view.imageSize().width >= kLargeImage_px ? 2 : 1),
      growth_(leastOf(view.coverage(), block_), leastOf(view.seeds(), block_), tolerance_, options.min_share,
              options.all_modes),
      light_(camera, view.cells(), FloorView::kCell, block_),
      patience_(kEvenLight),
      smoothing_(growth_, view, block_, options.smoothing_cells) {
  if (!options.all_modes) growth_.lookFar({camera, growth_.means().size(), blockSize()});
  constexpr int kMargin = 6;  // cells: growth compares a block with those beside it
  const std::vector<cv::Range> cells = view.rowsWithin(kMargin);
  for (int y = 0; y < growth_.means().rows; ++y) {
    const cv::Range& row = cells[static_cast<std::size_t>(y * block_)];
    asked_.emplace_back(row.start / block_, std::min(growth_.means().cols, (row.end + block_ - 1) / block_));
  }
}

void FloorReference::lookBeyond(const cv::Mat1b& sectors) {
  growth_.lookBeyond(leastOf(sectors, block_));
}

bool FloorReference::isGrown(int y, int x) const {
  y /= block_;
  x /= block_;
  return y < growth_.means().rows && x < growth_.means().cols && growth_.isGrown(y, x);
}

bool FloorReference::learn(const cv::Mat3f& cell_means, const FloorNoise& noise,
                           const std::vector<cv::Vec4f>& beyond) {
  averageBlocks(cell_means);
  if (!grow(noise / (FloorView::kCell * block_), beyond)) return false;
  smoothing_.smooth(growth_);
  if (growth_.isEvened()) smoothing_.shine(light_.ofCells());
  return true;
}

/// Once it is known how a lamp lights the floor, growth starts from there.
bool FloorReference::grow(const FloorNoise& noise, const std::vector<cv::Vec4f>& beyond) {
  if (options_.all_modes) return growth_.grow(noise, beyond);
  if (is_lamp_lit_) {
    if (growByLamp(noise, beyond)) return true;
    giveLampUp();
  }
  if (!growth_.grow(noise, beyond)) return false;
  const bool is_as_before = holdsFloor();
  if (!is_as_before) patience_ = kEvenLight;
  return (--until_look_ > 0 && is_as_before) || lookForLamp(noise, beyond);
}

/// @return false where it is no light of the floor any more
bool FloorReference::growByLamp(const FloorNoise& noise, const std::vector<cv::Vec4f>& beyond) {
  if (!growEvened(noise, beyond)) return false;
  is_lamp_lit_ = light_.fit(growth_) && light_.darkest() < kStillMatters;
  if (light_.change() > kOtherLight && !growEvened(noise, beyond)) return false;
  return holdsFloor();
}

/// Is there as much floor as in the last frames?
bool FloorReference::holdsFloor() {
  const auto grown = static_cast<double>(growth_.grown().size());
  most_grown_ = std::max(grown, (1.0 - kFades) * most_grown_);
  return grown > kLostFloor * most_grown_;
}

void FloorReference::giveLampUp() {
  growth_.leaveUneven();
  is_lamp_lit_ = false;
  until_look_ = 0;
  patience_ = kEvenLight;
}

/// It is learned from the floor that growth reaches without it, then from what growth reaches with that, and
/// believed where this is more.
bool FloorReference::lookForLamp(const FloorNoise& noise, const std::vector<cv::Vec4f>& beyond) {
  until_look_ = patience_;
  patience_ = std::min(2 * patience_, kRarely);
  light_.reset();
  const auto without = static_cast<double>(growth_.grown().size());
  most_grown_ = without;
  bool is_best = true;
  for (int look = 0; look < kLooks; ++look) {
    if (!light_.fit(growth_) || light_.darkest() > kMatters) {
      light_.goBack();
      break;
    }
    if (look > 0 && light_.change() <= kOtherLight) break;
    const auto grown = growEvened(noise, beyond) ? static_cast<double>(growth_.grown().size()) : 0.0;
    is_best = grown > most_grown_;
    if (!is_best) continue;
    most_grown_ = grown;
    light_.keep();
  }
  is_lamp_lit_ = most_grown_ > kMoreFloor * without;
  if (is_lamp_lit_ && !is_best) {
    light_.goBack();
    growEvened(noise, beyond);
  }
  if (is_lamp_lit_ || !growth_.isEvened()) return true;
  growth_.leaveUneven();
  return growth_.grow(noise, beyond);
}

bool FloorReference::growEvened(const FloorNoise& noise, const std::vector<cv::Vec4f>& beyond) {
  growth_.evenOut(light_.ofBlocks());
  return growth_.grow(noise, beyond);
}

void FloorReference::averageBlocks(const cv::Mat3f& cell_means) {
  cv::Mat3f& means = growth_.means();
  if (block_ == 1) {
    cell_means.copyTo(means);
    return;
  }
  for (int y = 0; y < means.rows; ++y) {
    const cv::Range& columns = asked_[static_cast<std::size_t>(y)];
    if (columns.empty()) continue;
    averageFours(cell_means.ptr<float>(2 * y) + 6 * columns.start,
                 cell_means.ptr<float>(2 * y + 1) + 6 * columns.start, columns.size(),
                 means.ptr<float>(y) + 3 * columns.start);
  }
}

}  // namespace omnifleet::ground
