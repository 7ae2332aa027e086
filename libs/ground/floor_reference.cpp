#include "ground/floor_reference.h"

#include <algorithm>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

// Frames until light that is even, or no lamp's, is looked at again, unless floor gets lost; twice as many
// each time that it still is, up to the latter: a look takes as long as a fifth of a frame's whole work.
constexpr int kEvenLight = 10, kRarely = 160;
constexpr double kMoreFloor = 1.01;  // what the light of a lamp must bring to be believed
// Of the most of the last frames, which fades by this share a frame: it may be believed no more. Of the last
// one alone: another lamp has been switched on.
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

bool FloorReference::learn(const CellColours& cells, const std::vector<cv::Vec4f>& beyond) {
  if (!grow({cells, cells.noise / block_, beyond})) return false;
  smoothing_.smooth(growth_);
  if (growth_.isEvened()) smoothing_.shine(light_.ofCells());
  return true;
}

/// Once it is known how a lamp lights the floor, growth starts from there. As long as it is not, this is
/// looked at now and then: in the first frame, and where a lamp is given up, at once, else by one growth a
/// frame beside the usual one, lest one frame in many takes twice as long as the others.
bool FloorReference::grow(const Sight& sight) {
  averageBlocks(sight.cells.means);
  if (options_.all_modes) return growBlocks(sight);
  bool at_once = most_grown_ <= 0.0;
  if (is_lamp_lit_) {
    if (growByLamp(sight)) return true;
    giveLampUp();
    at_once = true;
  }
  const bool looks = look_.left > 0;
  if (looks) tryLamp(sight);
  if (!growAsSeen(sight)) return false;
  const bool is_as_before = holdsFloor();
  if (!is_as_before) patience_ = kEvenLight;
  at_once = at_once || grownBlocks() < kLostFloor * last_grown_;
  last_grown_ = grownBlocks();
  if (looks) {
    judgeLamp(grownBlocks());
    return true;
  }
  if (--until_look_ > 0 && is_as_before) return true;
  beginLook();
  return look_.left == 0 || !at_once || lookAtOnce(sight);
}

/// @return false where it is no light of the floor any more
bool FloorReference::growByLamp(const Sight& sight) {
  if (!growEvened(sight)) return false;
  is_lamp_lit_ = light_.fit(growth_) && light_.darkest() < kStillMatters;
  if (light_.change() > kOtherLight && !growEvened(sight)) return false;
  return holdsFloor();
}

/// Is there as much floor as in the last frames?
bool FloorReference::holdsFloor() {
  most_grown_ = std::max(grownBlocks(), (1.0 - kFades) * most_grown_);
  return grownBlocks() > kLostFloor * most_grown_;
}

void FloorReference::giveLampUp() {
  is_lamp_lit_ = false;
  until_look_ = 0;
  patience_ = kEvenLight;
}

/// A lamp's light is learned from the floor that growth reaches without it, then from what growth reaches
/// with that, and believed where this is more.
void FloorReference::beginLook() {
  until_look_ = patience_;
  patience_ = std::min(2 * patience_, kRarely);
  most_grown_ = grownBlocks();
  light_.reset();
  const bool matters = light_.fit(growth_) && light_.darkest() <= kMatters;
  look_ = LampLook();
  if (matters) look_.left = kLooks;
}

/// Grows by the light that was fitted last and fits the next from there.
void FloorReference::tryLamp(const Sight& sight) {
  look_.grown = growEvened(sight) ? grownBlocks() : 0.0;
  if (--look_.left == 0) return;
  const bool is_other = light_.fit(growth_) && light_.darkest() <= kMatters && light_.change() > kOtherLight;
  if (!is_other) look_.left = 0;
}

/// @param without blocks that growth reaches in the same frame without a lamp
void FloorReference::judgeLamp(double without) {
  if (look_.grown > look_.best_share * without) {
    look_.best_share = look_.grown / without;
    light_.keepTried();
  }
  if (look_.left > 0) return;
  light_.goBack();
  is_lamp_lit_ = look_.best_share > kMoreFloor;
  if (is_lamp_lit_) most_grown_ = look_.best_share * without;
}

bool FloorReference::lookAtOnce(const Sight& sight) {
  const double without = grownBlocks();
  while (look_.left > 0) {
    tryLamp(sight);
    judgeLamp(without);
  }
  return is_lamp_lit_ ? growEvened(sight) : growAsSeen(sight);
}

bool FloorReference::growBlocks(const Sight& sight) {
  return growth_.grow(sight.noise, sight.beyond, sight.cells.is_smoothed);
}

bool FloorReference::growEvened(const Sight& sight) {
  growth_.evenOut(light_.ofBlocks());
  return growBlocks(sight);
}

bool FloorReference::growAsSeen(const Sight& sight) {
  if (growth_.isEvened()) averageBlocks(sight.cells.means);
  return growBlocks(sight);
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
