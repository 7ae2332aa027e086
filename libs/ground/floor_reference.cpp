#include "ground/floor_reference.h"

#include <algorithm>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

// Frames until the next search for a lamp's light, unless floor is lost. The interval doubles with each
// search without success, up to kRarely. A search takes 20 % of the work of a frame.
constexpr int kEvenLight = 10, kRarely = 160;
constexpr double kMoreFloor = 1.01;  // factor of floor that a lamp model must gain to be accepted
// The lamp model is dropped if the floor falls below kLostFloor of the maximum of the last frames, which
// decays by kFades per frame. A loss of the same size from one frame to the next starts a search at once:
// another lamp may have been switched on.
constexpr double kLostFloor = 0.95, kFades = 0.01;
// A lamp matters if some floor has less than kMatters of the light at the camera's foot. It continues to
// matter below kStillMatters.
constexpr double kMatters = 0.65, kStillMatters = 0.75;
constexpr double kOtherLight = 0.03;  // share of the brightness
constexpr int kSearchFrames = 3;      // each frame starts from more floor than the last
constexpr int kLargeImage_px = 900;   // from this width on, blocks consist of 2×2 cells
/// Means of n blocks of 2×2 cells, three numbers per block.
OMNIFLEET_WIDE void averageFours(const float* above, const float* below, int n, float* means) {
  using lanes::FourFloats;
  const auto meanAt = [above, below](int x) {
    const auto at = [x](const float* row, int cell) {
      return lanes::load<FourFloats>(row + 6 * x + 3 * cell);
    };
    return 0.25f * (at(above, 0) + at(above, 1) + at(below, 0) + at(below, 1));
  };
  // Each store writes one value too many, which the next store overwrites.
  for (int x = 0; x < n - 1; ++x) lanes::store(meanAt(x), means + 3 * x);
  for (int i = 3 * (n - 1); i < 3 * n; ++i) {
    const int first = 2 * i - i % 3;
    means[i] = 0.25f * (above[first] + above[first + 3] + below[first] + below[first + 3]);
  }
}

/// Minimum over each block of block × block cells, one value per whole block.
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
      growing_(leastOf(view.coverage(), block_), leastOf(view.seeds(), block_), tolerance_, options.min_share,
               options.all_modes),
      light_(camera, view.cells(), FloorView::kCell, block_),
      search_interval_(kEvenLight),
      smoothing_(growing_, view, block_, options.smoothing_cells) {
  if (!options.all_modes) growing_.useFarFloor({camera, growing_.means().size(), blockSize()});
  constexpr int kMargin = 6;  // cells; region growing compares a block with its neighbours
  const std::vector<cv::Range> cells = view.rowsWithin(kMargin);
  for (int y = 0; y < growing_.means().rows; ++y) {
    const cv::Range& row = cells[static_cast<std::size_t>(y * block_)];
    used_blocks_.emplace_back(row.start / block_,
                              std::min(growing_.means().cols, (row.end + block_ - 1) / block_));
  }
}

void FloorReference::setBeyondSectors(const cv::Mat1b& sectors) {
  growing_.setBeyondSectors(leastOf(sectors, block_));
}

bool FloorReference::isGrown(int y, int x) const {
  y /= block_;
  x /= block_;
  return y < growing_.means().rows && x < growing_.means().cols && growing_.isGrown(y, x);
}

bool FloorReference::learn(const CellColours& cells, const std::vector<cv::Vec4f>& beyond) {
  if (!grow({cells, cells.noise / block_, beyond})) return false;
  smoothing_.smooth(growing_);
  if (growing_.isEvened()) smoothing_.applyLight(light_.ofCells());
  return true;
}

/// Grows the floor. If a lamp model is known, growing starts with it. Otherwise the search for one runs from
/// time to time. It runs at once in the first frame, after a lamp model was dropped, and after a sudden loss
/// of floor. In other frames it adds one growing per frame to the usual one, so that no frame takes twice as
/// long as the others.
bool FloorReference::grow(const FrameInput& input) {
  averageBlocks(input.cells.means);
  if (options_.all_modes) return growBlocks(input);
  bool at_once = most_grown_ <= 0.0;
  if (is_lamp_lit_) {
    if (growByLamp(input)) return true;
    dropLamp();
    at_once = true;
  }
  const bool is_searching = search_.left > 0;
  if (is_searching) tryLamp(input);
  if (!growUnevened(input)) return false;
  const bool is_as_before = holdsFloor();
  if (!is_as_before) search_interval_ = kEvenLight;
  at_once = at_once || grownBlocks() < kLostFloor * last_grown_;
  last_grown_ = grownBlocks();
  if (is_searching) {
    judgeLamp(grownBlocks());
    return true;
  }
  if (--frames_until_search_ > 0 && is_as_before) return true;
  beginLampSearch();
  return search_.left == 0 || !at_once || searchAtOnce(input);
}

/// @return false if the lamp model no longer fits the floor
bool FloorReference::growByLamp(const FrameInput& input) {
  if (!growEvened(input)) return false;
  is_lamp_lit_ = light_.fit(growing_) && light_.darkest() < kStillMatters;
  if (light_.change() > kOtherLight && !growEvened(input)) return false;
  return holdsFloor();
}

/// True if there is about as much floor as in the last frames.
bool FloorReference::holdsFloor() {
  most_grown_ = std::max(grownBlocks(), (1.0 - kFades) * most_grown_);
  return grownBlocks() > kLostFloor * most_grown_;
}

void FloorReference::dropLamp() {
  is_lamp_lit_ = false;
  frames_until_search_ = 0;
  search_interval_ = kEvenLight;
}

/// Starts the search for a lamp. The light is fitted to the floor that growing reaches without a lamp, then
/// to the floor that growing reaches with that fit. The model is accepted if this gains floor.
void FloorReference::beginLampSearch() {
  frames_until_search_ = search_interval_;
  search_interval_ = std::min(2 * search_interval_, kRarely);
  most_grown_ = grownBlocks();
  light_.reset();
  const bool matters = light_.fit(growing_) && light_.darkest() <= kMatters;
  search_ = LampSearch();
  if (matters) search_.left = kSearchFrames;
}

/// Grows with the light that was fitted last, and fits the next one to the result.
void FloorReference::tryLamp(const FrameInput& input) {
  search_.grown = growEvened(input) ? grownBlocks() : 0.0;
  if (--search_.left == 0) return;
  const bool is_other = light_.fit(growing_) && light_.darkest() <= kMatters && light_.change() > kOtherLight;
  if (!is_other) search_.left = 0;
}

/// @param without number of blocks that growing reaches in the same frame without a lamp
void FloorReference::judgeLamp(double without) {
  if (search_.grown > search_.best_share * without) {
    search_.best_share = search_.grown / without;
    light_.keepUsed();
  }
  if (search_.left > 0) return;
  light_.restoreKept();
  is_lamp_lit_ = search_.best_share > kMoreFloor;
  if (is_lamp_lit_) most_grown_ = search_.best_share * without;
}

bool FloorReference::searchAtOnce(const FrameInput& input) {
  const double without = grownBlocks();
  while (search_.left > 0) {
    tryLamp(input);
    judgeLamp(without);
  }
  return is_lamp_lit_ ? growEvened(input) : growUnevened(input);
}

bool FloorReference::growBlocks(const FrameInput& input) {
  return growing_.grow(input.noise, input.beyond, input.cells.is_smoothed);
}

bool FloorReference::growEvened(const FrameInput& input) {
  growing_.evenOut(light_.ofBlocks());
  return growBlocks(input);
}

bool FloorReference::growUnevened(const FrameInput& input) {
  if (growing_.isEvened()) averageBlocks(input.cells.means);
  return growBlocks(input);
}

void FloorReference::averageBlocks(const cv::Mat3f& cell_means) {
  cv::Mat3f& means = growing_.means();
  if (block_ == 1) {
    cell_means.copyTo(means);
    return;
  }
  for (int y = 0; y < means.rows; ++y) {
    const cv::Range& columns = used_blocks_[static_cast<std::size_t>(y)];
    if (columns.empty()) continue;
    averageFours(cell_means.ptr<float>(2 * y) + 6 * columns.start,
                 cell_means.ptr<float>(2 * y + 1) + 6 * columns.start, columns.size(),
                 means.ptr<float>(y) + 3 * columns.start);
  }
}

}  // namespace omnifleet::ground
