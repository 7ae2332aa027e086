#include "ground/ground_segmenter.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
// Of the tolerances: a cell whose mean is nearer to floor is floor all over; one farther off, and all around
// it too, is object all over.
constexpr float kPlainFloor = 0.8f, kPlainObject = 3.0f;
// Of the squared tolerance of hue: beyond it a pixel has another hue than the floor in any light.
constexpr float kOtherHue = 2.0f;
constexpr int kAlign_px = 16;
constexpr double kRounding_px = 2.0;  // what the median adds where two lines cross

/// Side, in pixels, of a square that no floor marking holds, not even where two cross: √2 times its width,
/// seen at the middle of the seed region. Odd.
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

/// @param across2 squared difference of hue as a multiple of its tolerance
Look lookOf(float gain, float across2) {
  return across2 > kOtherHue ? kColourLook : greyLook(gain);
}

}  // namespace

SegmenterOptions SegmenterOptions::read(const options::Section& section) {
  SegmenterOptions o;
  section.read("method", o.method, {"local", "histogram"});
  section.read("histogram_share", o.histogram_share, {0.0, 0.5});
  section.read("histogram_grow", o.histogram_grow, {0, 8});
  section.read("shadows", o.shadows);
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
      reference_(view, options.reference),
      lines_(view.imageSize(), lineWidth(camera, view, options)),
      means_(view.cells(), cv::Vec3f(0, 0, 0)),
      raw_(view.imageSize(), std::uint8_t{0}),
      looks_(view.imageSize(), kFloorLook),
      objects_(view.imageSize(), std::uint8_t{0}),
      active_(view.cells(), std::uint8_t{0}),
      solid_(view.cells(), std::uint8_t{0}),
      row_sums_(static_cast<std::size_t>(view.imageSize().width) * 3),
      despeckler_(view.imageSize()),
      shade_(view.imageSize()) {}

bool GroundSegmenter::segment(const cv::Mat& image) {
  for (cv::Mat1b* mask : {&raw_, &looks_, &objects_}) clearStrips(strips_, *mask);
  despeckler_.clear(strips_);
  shade_.clear(strips_);
  strips_.clear();
  averageCells(image);
  const bool found = options_.method == "histogram" ? segmentByHistogram(image) : segmentLocal(image);
  if (!found) return false;
  despeckler_.trimHalos(strips_, raw_, objects_);
  despeckler_.clean(strips_, raw_, objects_);
  lines_.apply(strips_, objects_);
  if (options_.shadows && options_.method == "local" && image.channels() == 3)
    shade_.apply(strips_, {image, reference_.colour()}, looks_, raw_, despeckler_, objects_);
  return true;
}

bool GroundSegmenter::segmentLocal(const cv::Mat& image) {
  const double noise = seedNoise(image);
  if (!reference_.learn(means_, noise)) return false;
  findStrips(noise);
  for (const auto& strip : strips_) {
    if (image.channels() == 3)
      classifyStrip<3>(image, strip, noise);
    else
      classifyStrip<1>(image, strip, noise);
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
  reference_.learn(means_, 0.0);
  everythingIsAStrip();
  for (const auto& strip : strips_)
    for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y)
      for (int x = strip.begin_px; x < strip.end_px; ++x)
        raw_(y, x) = view_->mask()(y, x) != 0 && histogram_.table()[binAt(y, x)] == 0 ? 255 : 0;
  return true;
}

void GroundSegmenter::averageCells(const cv::Mat& image) {
  const int channels = image.channels();
  for (int y = 0; y < means_.rows; ++y) {
    const cv::Range range = view_->rows()[static_cast<std::size_t>(y)];
    if (range.empty()) continue;
    const int begin = range.start * kCell * channels, end = range.end * kCell * channels;
    const std::uint8_t* rows[kCell];
    for (int k = 0; k < kCell; ++k) rows[k] = image.ptr<std::uint8_t>(y * kCell + k);
    std::uint16_t* sums = row_sums_.data();
    for (int i = begin; i < end; ++i)
      sums[i] = static_cast<std::uint16_t>(rows[0][i] + rows[1][i] + rows[2][i] + rows[3][i]);
    auto* means = means_.ptr<cv::Vec3f>(y);
    constexpr float kShare = 1.0f / (kCell * kCell);
    for (int x = range.start; x < range.end; ++x) {
      const std::uint16_t* s = sums + x * kCell * channels;
      if (channels == 1) {
        means[x] = cv::Vec3f::all(static_cast<float>(s[0] + s[1] + s[2] + s[3]) * kShare);
      } else {
        for (int c = 0; c < 3; ++c)
          means[x][c] = static_cast<float>(s[c] + s[c + 3] + s[c + 6] + s[c + 9]) * kShare;
      }
    }
  }
}

double GroundSegmenter::seedNoise(const cv::Mat& image) const {
  // Median over the seed cells of the pixels' variance about the cell's mean, so that edges in the ring do
  // not count.
  const auto& seeds = view_->seeds();
  constexpr int kEvery = 5;  // cells: a fifth of them is plenty for a median
  const int channels = image.channels();
  std::vector<float> variances;
  for (int y = 0; y < seeds.rows; ++y) {
    for (int x = y % kEvery; x < seeds.cols; x += kEvery) {
      if (seeds(y, x) == 0) continue;
      float sum2 = 0.0f;
      for (int v = y * kCell; v < (y + 1) * kCell; ++v) {
        const auto* row = image.ptr<std::uint8_t>(v) + x * kCell * channels;
        for (int i = 0; i < kCell * channels; ++i) {
          const float d = static_cast<float>(row[i]) - means_(y, x)[i % channels];
          sum2 += d * d;
        }
      }
      variances.push_back(sum2 / static_cast<float>(channels * (kCell * kCell - 1)));
    }
  }
  if (variances.empty()) return 0.0;
  const auto middle = variances.begin() + static_cast<std::ptrdiff_t>(variances.size() / 2);
  std::nth_element(variances.begin(), middle, variances.end());
  return std::sqrt(static_cast<double>(*middle));
}

void GroundSegmenter::findStrips(double noise) {
  markCells(noise);
  // Strips begin and end at multiples of kAlign_px, so that the passes over them run without remainders.
  const int per = kAlign_px / kCell;
  for (int y = 0; y < active_.rows; ++y) {
    const std::uint8_t* row = active_.ptr(y);
    for (int x = 0; x < active_.cols; ++x) {
      if (row[x] == 0) continue;
      const int begin = x / per * per;
      int end = begin + per, quiet = 0;
      for (x = end; x < active_.cols && quiet < per; ++x) {
        quiet = row[x] != 0 ? 0 : quiet + 1;
        if (row[x] != 0) end = (x / per + 1) * per;
      }
      strips_.push_back({y, begin * kCell, std::min(end * kCell, raw_.cols)});
      x = end - 1;
    }
  }
}

void GroundSegmenter::markCells(double noise) {
  // Cells whose mean is not plainly floor, and their neighbours, are looked at.
  const auto& coverage = view_->coverage();
  active_.setTo(0);
  for (int y = 1; y + 1 < coverage.rows; ++y) {
    const cv::Range range = view_->rows()[static_cast<std::size_t>(y)];
    const auto* colour = reference_.colour().ptr<cv::Vec3f>(y);
    const auto* mean = means_.ptr<cv::Vec3f>(y);
    std::uint8_t* solid = solid_.ptr(y);
    FloorReference::Test test{0.0f, 0.0f};
    for (int x = std::max(range.start, 1); x < std::min(range.end, coverage.cols - 1); ++x) {
      solid[x] = 0;
      if (coverage(y, x) != 2) continue;  // cut cells show other things too; their neighbours speak for them
      const cv::Vec3f &r = colour[x], &p = mean[x];
      if (x % kCell == 0 || !(test.along2 > 0.0f))
        test = reference_.testFor(r, noise / kCell);  // changes slowly
      const float rr = std::max(1.0f, r.dot(r)), gain = p.dot(r) / rr, across2 = p.dot(p) / rr - gain * gain;
      const float off = std::max((gain - 1.0f) * (gain - 1.0f) / test.along2, across2 / test.across2);
      if (off <= kPlainFloor * kPlainFloor) continue;
      solid[x] = off > kPlainObject * kPlainObject ? lookOf(gain, across2 / test.across2) : kFloorLook;
      for (int dy = -1; dy <= 1; ++dy) std::fill_n(active_.ptr(y + dy) + x - 1, 3, std::uint8_t{1});
    }
  }
}

bool GroundSegmenter::isInside(int y, int x) const {
  if (y < 1 || x < 1 || y + 1 >= solid_.rows || x + 1 >= solid_.cols) return false;
  for (int dy = -1; dy <= 1; ++dy) {
    const std::uint8_t* row = solid_.ptr(y + dy) + x;
    if (row[-1] == 0 || row[0] == 0 || row[1] == 0) return false;
  }
  return view_->coverage()(y, x) == 2;
}

void GroundSegmenter::everythingIsAStrip() {
  for (int y = 0; y < view_->cells().height; ++y) {
    const cv::Range range = view_->rows()[static_cast<std::size_t>(y)];
    if (!range.empty()) strips_.push_back({y, range.start * kCell, range.end * kCell});
  }
}

template <int kChannels>
void GroundSegmenter::classifyStrip(const cv::Mat& image, const Strip& strip, double noise) {
  for (int cx = strip.begin_px / kCell; cx < strip.end_px / kCell; ++cx) {
    if (active_(strip.cell_row, cx) == 0) continue;
    if (isInside(strip.cell_row, cx)) {
      for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y) {
        std::fill_n(raw_.ptr(y) + cx * kCell, kCell, std::uint8_t{255});
        std::fill_n(looks_.ptr(y) + cx * kCell, kCell, solid_(strip.cell_row, cx));
      }
      continue;
    }
    const cv::Vec3f& r = reference_.colour()(strip.cell_row, cx);
    const float rr = std::max(1.0f, r.dot(r));
    const auto test = reference_.testFor(r, noise);
    const float along = 1.0f / test.along2, across = 1.0f / test.across2;
    for (int y = strip.cell_row * kCell; y < (strip.cell_row + 1) * kCell; ++y) {
      const std::uint8_t* p = image.ptr<std::uint8_t>(y) + cx * kCell * kChannels;
      const std::uint8_t* valid = view_->mask().ptr(y) + cx * kCell;
      std::uint8_t* out = raw_.ptr(y) + cx * kCell;
      Look* look = looks_.ptr(y) + cx * kCell;
      for (int i = 0; i < kCell; ++i, p += kChannels) {
        const auto b = static_cast<float>(p[0]), g = static_cast<float>(p[kChannels / 2]),
                   red = static_cast<float>(p[kChannels - 1]);
        const float gain = (b * r[0] + g * r[1] + red * r[2]) / rr;
        const float across2 = (b * b + g * g + red * red) / rr - gain * gain;
        const float off = std::max((gain - 1.0f) * (gain - 1.0f) * along, across2 * across);
        out[i] =
            valid[i] != 0 && off > 1.0f ? static_cast<std::uint8_t>(std::min(off, 255.0f)) : std::uint8_t{0};
        look[i] = out[i] != 0 ? lookOf(gain, across2 * across) : kFloorLook;
      }
    }
  }
}

}  // namespace omnifleet::ground
