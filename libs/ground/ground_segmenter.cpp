#include "ground/ground_segmenter.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>
#include <opencv2/imgproc.hpp>
#include <type_traits>

#include "ground/smoothed_cell.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
// Multiples of the tolerances. A cell whose mean is below kPlainFloor is entirely floor. A cell above
// kPlainObject whose neighbours are above it too is entirely object.
constexpr float kPlainFloor = 0.8f, kPlainObject = 3.0f;
// Maximum brightness difference of cells that show the same (an object or its shadow): kAlike of the floor's
// brightness, but at most kAlikeInTheDark of the brightest cell's.
constexpr float kAlike = 0.2f, kAlikeInTheDark = 0.5f;
// Share of the brightness at which the noise tolerance makes it necessary to average pixels with their
// neighbours first. Otherwise the tolerances would hide objects in the dark.
constexpr double kNoisyShare = 0.12;
constexpr double kSmoothing = 3.0;  // factor by which averaging reduces the noise
// A compressing camera (JPEG, 4:2:0) stores colours in blocks of 16 × 16 pixels. A strong colour rings over
// its whole block, by up to this share of its difference from the floor.
constexpr int kColourBlock = 16 / kCell;  // cells
constexpr float kRinging = 0.2f;
constexpr float kNoisy = 1.5f;     // multiple of the hue tolerance; above it, noise hides faint hues
constexpr float kLeastLit = 0.6f;  // share of the floor's brightness; below it, noise would create faint hues
constexpr int kAlign_px = 16;
constexpr double kRounding_px = 2.0;  // width that the median adds where two lines cross

/// Side of a square in pixels that fits into no floor marking, not even where two markings cross: √2 × the
/// marking's width, as seen in the middle of the seed region. Odd.
int lineWidth(const lens::Camera& camera, const FloorView& view, const SegmenterOptions& options) {
  double metres_per_px = 0.0;
  int count = 0;
  for (int y = 0; y < view.seeds().rows; ++y) {
    for (int x = 0; x < view.seeds().cols; ++x) {
      if (view.seeds()(y, x) == 0) continue;
      const Eigen::Vector2d pixel((x + 0.5) * kCell, (y + 0.5) * kCell);
      const auto a = camera.floorFromPixel(pixel), b = camera.floorFromPixel(pixel + Eigen::Vector2d(1, 0)),
                 c = camera.floorFromPixel(pixel + Eigen::Vector2d(0, 1));
      if (!a || !b || !c) continue;
      metres_per_px += std::min((*b - *a).norm(), (*c - *a).norm());
      ++count;
    }
  }
  if (count == 0 || options.line_width_m <= 0.0) return 0;
  const double width = std::sqrt(2.0) * options.line_width_m / (metres_per_px / count) + kRounding_px;
  return std::min(options.max_line_px, 2 * static_cast<int>(std::lround(0.5 * (width - 1.0))) + 1);
}

const std::vector<cv::Vec4f> kNothingBeyond;
constexpr std::size_t kAhead = 8;  // strips whose pixels are prefetched

/// A frame is larger than the processor's cache.
void prefetch(const cv::Mat& image, const Strip& strip) {
  constexpr int kLine = 64;  // bytes
  const int pixel = image.channels();
  for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y) {
    const std::uint8_t* row = image.ptr(y);
    for (int at = strip.begin_px * pixel; at < strip.end_px * pixel + kLine; at += kLine)
      __builtin_prefetch(row + at);
  }
}

/// First x in [begin, end) with a mark, or end if there is none.
int nextMark(const std::uint8_t* row, int begin, int end) {
  if (begin < end && row[begin] == 1) return begin;  // marks are mostly adjacent
  const auto* mark =
      static_cast<const std::uint8_t*>(std::memchr(row + begin, 1, static_cast<std::size_t>(end - begin)));
  return mark == nullptr ? end : static_cast<int>(mark - row);
}

/// Noise that widens the hue tolerance to that of a channel. Pixels along an outline are mixed, so with the
/// fine tolerance even a small share of a strong hue would count as object.
FloorNoise coarseNoise(const FloorNoise& noise) {
  return {noise.channel, noise.channel};
}

CellTolerance toleranceWith(const ReferenceOptions& o, const FloorNoise& noise) {
  const auto number = [](double v) { return static_cast<float>(v); };
  return {number(o.tolerance_along), number(o.tolerance_across), number(o.noise_sigmas),
          number(noise.channel), number(noise.hue)};
}

/// Appearance class of a cell that is entirely object; kFloorAppearance if it may be mixed.
Appearance appearanceOf(const CellHues& hues, std::size_t i) {
  if (!(hues.off(i) > kPlainObject * kPlainObject)) return kFloorAppearance;
  return hues.hueOff(i) > kOtherHue ? kColourAppearance : greyAppearance(hues.gain(i));
}

}  // namespace

SegmenterOptions SegmenterOptions::read(const options::Section& section) {
  SegmenterOptions o;
  section.read("method", o.method, {"local", "histogram"});
  section.read("histogram_share", o.histogram_share, {0.0, 0.5});
  section.read("histogram_grow", o.histogram_grow, {0, 8});
  section.read("shadows", o.shadows);
  section.read("low_walls", o.low_walls);
  section.read("line_width_m", o.line_width_m, {0.0, 0.2});
  section.read("max_line_px", o.max_line_px, {0, LineFilter::kMaxWidth_px});
  o.reference = ReferenceOptions::read(section.child("reference"));
  section.finish();
  return o;
}

GroundSegmenter::GroundSegmenter(const lens::Camera& camera, const FloorView& view,
                                 const SegmenterOptions& options)
    : view_(&view),
      options_(options),
      meter_(view),
      hue_smoother_(view),
      reference_(camera, view, options.reference),
      lines_(view.imageSize(), lineWidth(camera, view, options)),
      cells_(view),
      strength_(view.imageSize(), std::uint8_t{0}),
      raw_(view.imageSize(), std::uint8_t{0}),
      appearances_(view.imageSize(), kFloorAppearance),
      objects_(view.imageSize(), std::uint8_t{0}),
      off_(view.cells().height + 2, view.cells().width + 2, std::uint8_t{0}),
      hues_(view.cells().width),
      limits_(view.cells().width),
      across2_(off_.size(), 0.0f),
      active_(view.cells(), std::uint8_t{0}),
      solid_(view.cells(), std::uint8_t{0}),
      hue2_(view.cells().height / kColourBlock + 3, view.cells().width / kColourBlock + 3, 0.0f),
      around_(static_cast<std::size_t>(view.cells().width), kMixed),
      area_(view.imageSize()),
      raw_bits_(view.imageSize()),
      bits_(view.imageSize()),
      with_lines_(view.imageSize()),
      far_objects_(camera),
      hued_cells_(view.imageSize()),
      despeckler_(view.imageSize()),
      intensity_edges_(camera, view, reference_.growing(), reference_.blockSize() / kCell),
      coarse_texture_(camera, view, reference_.growing(), reference_.blockSize() / kCell),
      lamp_shadows_(view),
      shadow_(view.imageSize()),
      completer_(camera, view.imageSize()) {
  if (options.method == "local" && !options.reference.all_modes) {
    horizon_ = std::make_unique<Horizon>(camera, view);
    reference_.setBeyondSectors(horizon_->sectors());
    if (options.low_walls) low_walls_ = std::make_unique<LowWalls>(camera, view);
  }
}

bool GroundSegmenter::segment(const cv::Mat& image) {
  last_strips_.swap(strips_);
  completer_.clear();
  strips_.clear();
  cells_.read(image);
  noise_ = meter_.measure(image, cells_.means());
  const bool found = options_.method == "histogram" ? segmentByHistogram(image) : segmentLocal(image);
  for (BitMask* bits : {&raw_bits_, &bits_}) clear(area_, *bits);
  shadow_.clear();
  intensity_edges_.clear();
  coarse_texture_.clear();
  regions_with_lines_ = nullptr;
  area_.cover(strips_);
  if (!found) {
    for (cv::Mat1b* mask : {&strength_, &raw_, &appearances_, &objects_}) clearStrips(last_strips_, *mask);
    return false;
  }
  Despeckler::trimHalos(strips_, strength_, raw_);
  pack(strips_, raw_, raw_bits_);
  despeckler_.clean(area_, raw_bits_, bits_);
  const bool distinguishes_shadow = options_.shadows && options_.method == "local" && image.channels() == 3;
  if (distinguishes_shadow) with_lines_ = bits_;
  lines_.apply(area_, bits_);
  if (distinguishes_shadow) {
    const std::vector<Blob>* regions = &labeller_.label(bits_, area_, ShadowFilter::kMinRegion_px);
    const bool has_low_walls = low_walls_ && findLowWalls(image, *regions);
    if (has_low_walls ||
        (regions_with_lines_ != nullptr && far_objects_.restore(*regions_with_lines_, bits_)))
      regions = &labeller_.label(bits_, area_, ShadowFilter::kMinRegion_px);
    if (FloorLight* light = reference_.lampLight()) lamp_shadows_.mark(*light, *regions, appearances_);
    shadow_.apply({strips_, *regions, appearances_, raw_}, shadowFrame(image), despeckler_, bits_);
    complete(image);
    if (low_walls_) {
      intensity_edges_.find(reference_.growing(), static_cast<float>(options_.reference.tolerance_along));
      coarse_texture_.find(reference_.growing(), bits_);
    }
  }
  clearStrips(last_strips_, objects_);
  unpack(strips_, bits_, objects_);
  if (hasLowWalls()) low_walls_->mark(objects_);
  return true;
}

/// Far walls may be as thin as markings, so that the line filter leaves only pieces of their ring. The search
/// is then repeated on the mask before the line filter, and on cells with a faint hue.
bool GroundSegmenter::findLowWalls(const cv::Mat& image, const std::vector<Blob>& regions) {
  if (low_walls_->find(image, regions, area_, reference_.colour(), bits_)) return true;
  regions_with_lines_ = &labeller_with_lines_.label(with_lines_, area_, ShadowFilter::kMinRegion_px);
  if (low_walls_->find(image, *regions_with_lines_, area_, reference_.colour(), with_lines_, true)) {
    lines_.apply(area_, with_lines_);
    std::swap(bits_, with_lines_);
    return true;
  }
  if (!is_smoothed_) return false;
  const HuedCells::Frame cells{off_,
                               across2_,
                               colours_,
                               reference_.colour(),
                               static_cast<float>(options_.reference.tolerance_across),
                               static_cast<float>(cell_noise_.hue)};
  const std::vector<Blob>& hued = hued_cells_.find(cells, area_);
  return low_walls_->findFaint(image, hued, area_, reference_.colour(), colours_, bits_);
}

/// Completes objects of which only a part clearly differs from the floor. The strips then cover the result.
/// Outside the previous strips all masks are 0.
void GroundSegmenter::complete(const cv::Mat& image) {
  const ShadowFilter::Frame frame = shadowFrame(image);
  if (!completer_.complete({frame, view_->mask(), appearances_, bits_},
                           {raw_bits_, with_lines_, hasLowWalls() ? nullptr : regions_with_lines_}, shadow_,
                           {bits_, active_}))
    return;
  strips_.clear();
  gatherStrips();
  area_.cover(strips_);
}

void GroundSegmenter::relabelOutside(const Blob& region, const BitMask& kept, std::uint8_t other) {
  for (const Run& run : region.runs) {
    std::uint8_t* row = objects_.ptr(run.row);
    for (int x = run.begin; x < run.end; ++x)
      if (!kept.at(x, run.row)) row[x] = other;
  }
}

ShadowFilter::Frame GroundSegmenter::shadowFrame(const cv::Mat& image) const {
  const auto& o = options_.reference;
  return {image,
          reference_.colour(),
          static_cast<float>(o.tolerance_across),
          static_cast<float>(o.noise_sigmas * noise_.channel),
          completer_.foot(),
          view_->mask()};
}

bool GroundSegmenter::segmentLocal(const cv::Mat& image) {
  const FloorNoise& noise = noise_;
  if (horizon_) horizon_->read(image);
  const CellColours cells = hue_smoother_.smooth(cells_.means(), noise, options_.reference.tolerance_across);
  colours_ = cells.means;
  cell_noise_ = cells.noise;
  is_smoothed_ = cells.is_smoothed;
  if (!reference_.learn(cells, horizon_ ? horizon_->colours() : kNothingBeyond)) return false;
  findStrips(noise);
  // Cleared only now, because the following loop writes mostly the same memory. It then passes through the
  // cache once.
  for (cv::Mat1b* mask : {&strength_, &raw_, &appearances_}) clearStrips(last_strips_, *mask);
  for (std::size_t i = 0; i < strips_.size(); ++i) {
    if (i + kAhead < strips_.size()) prefetch(image, strips_[i + kAhead]);
    if (image.channels() == 3)
      classifyStrip<3>(image, strips_[i], noise);
    else
      classifyStrip<1>(image, strips_[i], noise);
  }
  return true;
}

bool GroundSegmenter::segmentByHistogram(const cv::Mat& image) {
  const auto binAt = [&](int y, int x) {
    if (image.channels() == 1) {
      const auto grey = image.at<std::uint8_t>(y, x);
      return GroundHistogram::binOf(grey, grey, grey);
    }
    const auto& c = image.at<cv::Vec3b>(y, x);
    return GroundHistogram::binOf(c[0], c[1], c[2]);
  };
  const auto& seeds = view_->seeds();
  histogram_.clear();
  for (int y = 0; y < seeds.rows * kCell; ++y)
    for (int x = 0; x < seeds.cols * kCell; ++x)
      if (seeds(y / kCell, x / kCell) != 0) histogram_.add(binAt(y, x));
  if (histogram_.settle(options_.histogram_share, options_.histogram_grow, true) <= 0.0) return false;
  reference_.learn({cells_.means(), {}, false});
  coverViewWithStrips();
  for (const auto& strip : strips_)
    for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y)
      for (int x = strip.begin_px; x < strip.end_px; ++x)
        strength_(y, x) = view_->mask()(y, x) != 0 && histogram_.table()[binAt(y, x)] == 0 ? 255 : 0;
  return true;
}

void GroundSegmenter::findStrips(const FloorNoise& noise) {
  markCells(noise);
  gatherStrips();
}

void GroundSegmenter::gatherStrips() {
  // Strips begin and end at multiples of kAlign_px, so that loops over them have no remainder.
  const int per = kAlign_px / kCell;
  for (int y = 0; y < active_.rows; ++y) {
    const std::uint8_t* row = active_.ptr(y);
    for (int x = nextMark(row, 0, active_.cols); x < active_.cols; x = nextMark(row, x, active_.cols)) {
      const int begin = x / per * per;
      int end = begin + per, quiet = 0;
      for (x = end; x < active_.cols && quiet < per; ++x) {
        quiet = row[x] != 0 ? 0 : quiet + 1;
        if (row[x] != 0) end = (x / per + 1) * per;
      }
      strips_.push_back({y, begin * kCell, std::min(end * kCell, raw_.cols)});
      x = end;
    }
  }
}

/// Activates the cells whose mean is not clearly floor, and their neighbours.
void GroundSegmenter::markCells(const FloorNoise& noise) {
  const auto& coverage = view_->coverage();
  const auto& o = options_.reference;
  const auto share = [](double v) { return kPlainFloor * static_cast<float>(v); };
  const OffTest test{share(o.tolerance_along), share(o.tolerance_across),
                     share(o.noise_sigmas * cell_noise_.channel), share(o.noise_sigmas * cell_noise_.hue)};
  const FloorNoise coarse = coarseNoise(noise) / kCell;
  const CellTolerance tolerance = toleranceWith(o, coarse);
  hue2_ = 0.0f;
  for (int y = 1; y + 1 < coverage.rows; ++y) {
    const cv::Range range = view_->rows()[static_cast<std::size_t>(y)];
    const int first = std::max(range.start, 1), last = std::min(range.end, coverage.cols - 1);
    if (first >= last) continue;
    std::uint8_t* off = off_.ptr(y + 1) + 1;
    findOff(colours_.ptr<float>(y) + 3 * first, reference_.colour().ptr<float>(y) + 3 * first, last - first,
            test, off + first);
    std::fill(solid_.ptr(y) + first, solid_.ptr(y) + last, std::uint8_t{0});
    std::fill(across2_.ptr<float>(y + 1) + first + 1, across2_.ptr<float>(y + 1) + last + 1, 0.0f);
    hues_.clear();
    for (int x = nextMark(off, first, last); x < last; x = nextMark(off, x + 1, last)) {
      // Cells that the view cuts show other objects too. Their neighbours decide instead.
      if (coverage(y, x) == 2)
        hues_.add(x, colours_.ptr<float>(y) + 3 * x, reference_.colour().ptr<float>(y) + 3 * x);
      else
        off[x] = 0;
    }
    hues_.compare(tolerance);
    for (std::size_t i = 0; i < hues_.size(); ++i) {
      const int x = hues_.x(i);
      solid_(y, x) = appearanceOf(hues_, i);
      across2_(y + 1, x + 1) = hues_.across2(i);
      spreadHue(x, y, hues_.across2(i));
    }
  }
  for (int y = 0; y < active_.rows; ++y)
    spreadMarks(off_.ptr(y), off_.ptr(y + 1), off_.ptr(y + 2), active_.cols, active_.ptr(y));
}

/// Marks all JPEG colour blocks that contain the cell or are near it. A block may hold only a corner of the
/// object itself.
void GroundSegmenter::spreadHue(int x, int y, float across2) {
  const int left = (x + kColourBlock / 2) / kColourBlock, top = (y + kColourBlock / 2) / kColourBlock;
  for (int by = top; by <= top + 1; ++by)
    for (int bx = left; bx <= left + 1; ++bx) hue2_(by, bx) = std::max(hue2_(by, bx), across2);
}

/// Direction that separates pixels of a faint hue from floor pixels (CellTest::to_blue, to_green, to_red), or
/// 0. It applies where an object's hue differs from the floor's by less than the noise of single pixels, but
/// by more than the noise of a cell's mean. Pixels nearer to the hue of the strongest neighbouring cell than
/// to the floor's hue then count as object. Faces of an object differ in brightness, not in hue.
/// @param strongest2 largest CellHues::across2 nearby
/// @param pixel tolerances for single pixels
cv::Vec3f GroundSegmenter::faintHue(int x, int y, float strongest2, const FloorTest& pixel) const {
  const auto tolerance = static_cast<float>(options_.reference.tolerance_across);
  if (strongest2 <= kOtherHue * tolerance * tolerance) return {};  // most cells are grey
  if (pixel.across2 < kNoisy * kNoisy * tolerance * tolerance) return {};
  const int width = off_.cols, at = (y + 1) * width + x + 1;
  const float* across2 = across2_.ptr<float>() + at;  // 0 where a cell is not off
  constexpr float kBright2 = 4.0f;  // maximum squared brightness of an object relative to the floor
  if (across2[0] >= kBright2 * 4.0f * pixel.across2) return {};
  const std::array<int, 9> near = {-width - 1, -width, -width + 1, -1, 0, 1, width - 1, width, width + 1};
  float most2 = 0.0f;
  for (const int k : near) most2 = std::max(most2, across2[k]);
  if (most2 <= kRinging * kRinging * strongest2) return {};
  const int strongest = *std::find_if(near.begin(), near.end(), [&](int k) { return across2[k] == most2; });
  const cv::Vec3f &r = reference_.colour()(y, x),
                  &p = colours_((at + strongest) / width - 1, (at + strongest) % width - 1);
  const float gain = p.dot(r) / std::max(1.0f, r.dot(r));
  if (most2 >= 4.0f * pixel.across2 * gain * gain) return {};
  if (most2 <= kOtherHue * reference_.testFor(r, cell_noise_).across2) return {};
  const cv::Vec3f hue = p - gain * r;
  // The threshold is halfway to the object's hue, but outside the floor's tolerance.
  const float share = std::sqrt(hue.dot(hue) / std::max(1.0f, r.dot(r))) / gain;
  return std::min(2.0f, share / tolerance) * gain / std::max(1.0f, hue.dot(hue)) * hue;
}

/// Floor test for pixels that are averaged with their neighbours. The reference is an average too. Where the
/// illumination changes quickly it may differ by the change over one cell, which the reduced noise no longer
/// covers.
FloorTest GroundSegmenter::testOfSmoothed(int x, int y, const FloorNoise& noise) const {
  const cv::Mat3f& floor = reference_.colour();
  const cv::Vec3f& r = floor(y, x);
  const cv::Vec3f across = floor(y, std::min(x + 1, floor.cols - 1)) - floor(y, std::max(x - 1, 0)),
                  down = floor(std::min(y + 1, floor.rows - 1), x) - floor(std::max(y - 1, 0), x);
  const float slope = 0.5f * std::sqrt((across.dot(across) + down.dot(down)) / std::max(1.0f, r.dot(r)));
  FloorTest test = reference_.testFor(r, noise / kSmoothing);
  const float along = std::sqrt(test.along2) + slope;
  test.along2 = along * along;
  return test;
}

/// Sets around_ for the cells of the strip. It is not kMixed where a cell and all its neighbours are clearly
/// object.
void GroundSegmenter::findInside(const Strip& strip) {
  const int y = strip.cell_row, begin = strip.begin_px / kCell, end = strip.end_px / kCell;
  std::fill(around_.begin() + begin, around_.begin() + end, kMixed);
  if (y < 1 || y + 1 >= solid_.rows) return;
  const int first = std::max(begin, 1), last = std::min(end, solid_.cols - 1);
  if (first >= last) return;
  const auto row = [&](int k) { return solid_.ptr(y + k) + first - 1; };
  const float deepest = reference_.lampLight() != nullptr ? 0.0f : kDeepestShadow;
  classifyAround(row(-1), row(0), row(1), last - first, deepest, around_.data() + first);
  for (int x = first; x < last; ++x) {
    Around& around = around_[static_cast<std::size_t>(x)];
    if (view_->coverage()(y, x) != 2 || (around == kSomeShadow && !isOneKind(y, x))) around = kMixed;
  }
}

/// True if the 3×3 cells show one kind of surface. Otherwise the border between an object and its shadow is
/// located pixel by pixel.
bool GroundSegmenter::isOneKind(int y, int x) const {
  Appearance least = 255, most = kFloorAppearance;
  for (int dy = -1; dy <= 1; ++dy) {
    const Appearance* row = solid_.ptr(y + dy) + x;
    for (int dx = -1; dx <= 1; ++dx) {
      least = std::min(least, row[dx]);
      most = std::max(most, row[dx]);
    }
  }
  const float alike = std::min(kAlike, kAlikeInTheDark * gainOf(most));
  return isGrey(least) && gainOf(most) - gainOf(least) < alike;
}

void GroundSegmenter::coverViewWithStrips() {
  for (int y = 0; y < view_->cells().height; ++y) {
    const cv::Range range = view_->rows()[static_cast<std::size_t>(y)];
    if (!range.empty()) strips_.push_back({y, range.start * kCell, range.end * kCell});
  }
}

template <int kChannels>
void GroundSegmenter::classifyStrip(const cv::Mat& image, const Strip& strip, const FloorNoise& noise) {
  findInside(strip);
  limits_.clear();
  for (int cx = strip.begin_px / kCell; cx < strip.end_px / kCell; ++cx) {
    if (active_(strip.cell_row, cx) == 0) continue;
    if (around_[static_cast<std::size_t>(cx)] == kMixed) {
      limits_.add(cx, reference_.colour().ptr<float>(strip.cell_row) + 3 * cx);
      continue;
    }
    for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y) {
      std::fill_n(strength_.ptr(y) + cx * kCell, kCell, std::uint8_t{255});
      std::fill_n(appearances_.ptr(y) + cx * kCell, kCell, solid_(strip.cell_row, cx));
    }
  }
  const FloorNoise coarse = coarseNoise(noise);
  limits_.settle(toleranceWith(options_.reference, coarse));
  for (std::size_t i = 0; i < limits_.size(); ++i) classifyCell<kChannels>(image, i, strip.cell_row, coarse);
}

/// @param i index of the cell in limits_
template <int kChannels>
void GroundSegmenter::classifyCell(const cv::Mat& image, std::size_t i, int cell_y, const FloorNoise& noise) {
  const int cell_x = limits_.x(i);
  const cv::Vec3f& r = reference_.colour()(cell_y, cell_x);
  const bool is_noisy =
      options_.reference.noise_sigmas * noise.channel > kNoisyShare * static_cast<double>(limits_.length(i));
  const FloorTest limits =
      is_noisy ? testOfSmoothed(cell_x, cell_y, noise) : FloorTest{limits_.along2(i), limits_.across2(i)};
  const float hue2 = hue2_(cell_y / kColourBlock + 1, cell_x / kColourBlock + 1);
  const cv::Vec3f to = kChannels == 3 ? faintHue(cell_x, cell_y, hue2, limits) : cv::Vec3f();
  const CellTest test{r[0],
                      r[1],
                      r[2],
                      limits_.squared(i),
                      1.0f / limits.along2,
                      1.0f / limits.across2,
                      kRinging * kRinging * hue2 / limits.across2,
                      kOtherHue,
                      to[0],
                      to[1],
                      to[2],
                      kLeastLit};
  const int x = cell_x * kCell, y = cell_y * kCell;
  const auto at = [&](auto& mask) {
    return CellBytes<std::remove_pointer_t<decltype(mask.ptr(y))>>{mask.ptr(y) + x,
                                                                   static_cast<std::ptrdiff_t>(mask.step[0])};
  };
  static constexpr std::array<std::uint8_t, kCell> kAllValid{255, 255, 255, 255};
  const CellBytes<const std::uint8_t> valid = view_->coverage()(cell_y, cell_x) == 2
                                                  ? CellBytes<const std::uint8_t>{kAllValid.data(), 0}
                                                  : at(view_->mask());
  CellBytes<const std::uint8_t> pixels{image.ptr(y) + x * kChannels,
                                       static_cast<std::ptrdiff_t>(image.step[0])};
  std::uint8_t copy[kCell * kCopyRow];
  if (is_noisy) {
    smoothCell<kChannels>(image, x, y, copy);
    pixels = {copy, kCopyRow};
  } else if (kChannels == 3 && x + kCell + 2 > image.cols) {  // avoids reading beyond the image's end
    for (int k = 0; k < kCell; ++k) std::memcpy(copy + k * kCopyRow, image.ptr(y + k) + x * 3, kCell * 3);
    pixels = {copy, kCopyRow};
  }
  if constexpr (kChannels == 3)
    testColourCell(pixels, test, valid, at(strength_), at(appearances_));
  else
    testGreyCell(pixels, test, valid, at(strength_), at(appearances_));
}

}  // namespace omnifleet::ground
