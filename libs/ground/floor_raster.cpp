#include "ground/floor_raster.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

#include "geometry/lanes.h"
#include "options/options.h"

namespace omnifleet::ground {
namespace {

constexpr int kMargin = 3;            // cells of floor needed around a cell
constexpr int kObjectMargin = 2;      // cells by which objects are dilated
constexpr int kWide = 5;              // reach of the wide mean, in double cells
constexpr float kGrey = 64.0f;        // value of one grey level
constexpr float kDarkest = 4.0f;      // grey levels: below, contrast is not scaled up further
constexpr float kMemory = 64.0f;      // rasters, of the mean of what is fixed in the image
constexpr float kChance = 9.0f;       // squared σ of the mean by chance that are never taken for fixed
constexpr float kFewest = 6.0f;       // rasters before anything is taken for fixed
constexpr float kLargest = 16000.0f;  // value of a cell
constexpr float kStrong = 4.0f;       // multiple of the contrast; more is no texture (an unmasked object)
constexpr int kLeastLimit = 40;       // value, of the same
constexpr int kChunk = 256;           // cells that are sampled at a time
using Kernel = std::array<float, kWide + 1>;

/// Gaussian weights of σ 2 double cells, from the middle outwards; their sum over both sides is 1.
Kernel wideKernel() {
  Kernel kernel{};
  float sum = 0.0f;
  for (int k = 0; k <= kWide; ++k) {
    kernel[static_cast<std::size_t>(k)] = std::exp(-0.125f * static_cast<float>(k * k));
    sum += (k == 0 ? 1.0f : 2.0f) * kernel[static_cast<std::size_t>(k)];
  }
  for (float& weight : kernel) weight /= sum;
  return kernel;
}

/// Bilinear interpolation. @param top, bottom the upper and lower two pixels around each tap
/// @param second_bit of the right pixel in these
OMNIFLEET_WIDE void mixTaps(const std::uint32_t* top, const std::uint32_t* bottom, int second_bit,
                            const std::uint16_t* shares, int n, std::uint32_t* mixed) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const auto p = static_cast<std::int32_t>(top[i] & 0xff),
               q = static_cast<std::int32_t>(top[i] >> second_bit & 0xff),
               r = static_cast<std::int32_t>(bottom[i] & 0xff),
               s = static_cast<std::int32_t>(bottom[i] >> second_bit & 0xff);
    const std::int32_t a = shares[i] & 0xff, b = shares[i] >> 8;
    const std::int32_t above = 128 * p + a * (q - p), below = 128 * r + a * (s - r);
    mixed[i] = static_cast<std::uint32_t>((128 * above + b * (below - above)) >> 8);
  }
}

template <int kTaps>
OMNIFLEET_INLINE void meanOfTaps(const std::uint32_t* mixed, int n, std::uint16_t* grey) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    std::uint32_t sum = 0;
    for (int k = 0; k < kTaps; ++k) sum += mixed[kTaps * i + k];
    grey[i] = static_cast<std::uint16_t>(sum / kTaps);
  }
}
OMNIFLEET_WIDE void meanOfOne(const std::uint32_t* mixed, int n, std::uint16_t* grey) {
  meanOfTaps<1>(mixed, n, grey);
}
OMNIFLEET_WIDE void meanOfTwo(const std::uint32_t* mixed, int n, std::uint16_t* grey) {
  meanOfTaps<2>(mixed, n, grey);
}
OMNIFLEET_WIDE void meanOfFour(const std::uint32_t* mixed, int n, std::uint16_t* grey) {
  meanOfTaps<4>(mixed, n, grey);
}

/// Four bytes from each offset, in one row and the next.
void gather(const std::uint8_t* image, std::size_t step, const std::int32_t* offsets, int n,
            std::uint32_t* top, std::uint32_t* bottom) {
  for (int i = 0; i < n; ++i) {
    const std::uint8_t* at = image + offsets[i];
    std::memcpy(top + i, at, 4);
    std::memcpy(bottom + i, at + step, 4);
  }
}

/// Dilates a mask by kReach cells in both directions. `buffer` has its size.
template <int kReach>
OMNIFLEET_INLINE void dilateBy(const cv::Mat1b& in, cv::Mat1b& buffer, cv::Mat1b& out) {
  const int n = in.cols;
  for (int y = 0; y < in.rows; ++y) {
    const std::uint8_t* from = in.ptr(y);
    std::uint8_t* to = buffer.ptr(y);
#pragma GCC ivdep
    for (int x = kReach; x < n - kReach; ++x) {
      std::uint8_t any = 0;
      for (int k = -kReach; k <= kReach; ++k) any |= from[x + k];
      to[x] = any;
    }
  }
  for (int y = kReach; y < in.rows - kReach; ++y) {
    std::array<const std::uint8_t*, 2 * kReach + 1> from{};
    for (int k = 0; k <= 2 * kReach; ++k) from[static_cast<std::size_t>(k)] = buffer.ptr(y + k - kReach);
    std::uint8_t* to = out.ptr(y);
#pragma GCC ivdep
    for (int x = 0; x < n; ++x) {
      std::uint8_t any = 0;
      for (std::size_t k = 0; k <= 2 * kReach; ++k) any |= from[k][x];
      to[x] = any;
    }
  }
}
OMNIFLEET_WIDE void dilateObjects(const cv::Mat1b& in, cv::Mat1b& buffer, cv::Mat1b& out) {
  dilateBy<kObjectMargin>(in, buffer, out);
}
OMNIFLEET_WIDE void dilateMargin(const cv::Mat1b& in, cv::Mat1b& buffer, cv::Mat1b& out) {
  dilateBy<kMargin>(in, buffer, out);
}

OMNIFLEET_WIDE void exclude(const std::uint8_t* from, const std::uint8_t* excluded, int n, std::uint8_t* to) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) to[i] = static_cast<std::uint8_t>(from[i] & (excluded[i] == 0 ? 1 : 0));
}

/// Sums of 2 × 2 cells where there is floor.
OMNIFLEET_WIDE void sumFour(const std::uint16_t* grey, const std::uint8_t* floor, int step, int n,
                            float* sums, float* counts) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const std::uint16_t *g = grey + 2 * i, *h = g + step;
    const std::uint8_t *f = floor + 2 * i, *e = f + step;
    sums[i] = static_cast<float>(g[0] * f[0] + g[1] * f[1] + h[0] * e[0] + h[1] * e[1]);
    counts[i] = static_cast<float>(f[0] + f[1] + e[0] + e[1]);
  }
}

/// out[i] = Σ kernel[|k|] · in[i + k · step]
OMNIFLEET_WIDE void convolve(const float* in, std::ptrdiff_t step, const Kernel& kernel, int n, float* out) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    float sum = kernel[0] * in[i];
    for (int k = 1; k <= kWide; ++k)
      sum += kernel[static_cast<std::size_t>(k)] * (in[i + k * step] + in[i - k * step]);
    out[i] = sum;
  }
}

OMNIFLEET_WIDE void invert(const float* sums, const float* counts, int n, float* scale) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const float least = kDarkest * kGrey * counts[i] + 1e-3f;
    scale[i] = counts[i] / (sums[i] > least ? sums[i] : least);
  }
}

/// Contrast against the wide mean, smoothed along the row with the weights 1, 4, 6, 4, 1 (σ 1 cell).
OMNIFLEET_WIDE void contrastOfRow(const std::uint16_t* grey, const std::uint8_t* floor, const float* scale,
                                  int n, float* contrast, float* smooth) {
#pragma GCC ivdep
  for (int i = 0; i < n / 2; ++i) {
    contrast[2 * i] = static_cast<float>(floor[2 * i]) * (static_cast<float>(grey[2 * i]) * scale[i] - 1.0f);
    contrast[2 * i + 1] =
        static_cast<float>(floor[2 * i + 1]) * (static_cast<float>(grey[2 * i + 1]) * scale[i] - 1.0f);
  }
#pragma GCC ivdep
  for (int i = 2; i < n - 2; ++i)
    smooth[i] =
        6.0f * contrast[i] + 4.0f * (contrast[i - 1] + contrast[i + 1]) + (contrast[i - 2] + contrast[i + 2]);
}

OMNIFLEET_WIDE void smoothAcross(const float* const* rows, int n, std::int16_t* out) {
  const float *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3], *e = rows[4];
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const float sum = 6.0f * c[i] + 4.0f * (b[i] + d[i]) + (a[i] + e[i]);
    const float value = sum * (FloorRaster::kOne / 256.0f);
    const float limited = value > kLargest ? kLargest : value < -kLargest ? -kLargest : value;
    out[i] = static_cast<std::int16_t>(static_cast<std::int32_t>(limited + 32768.5f) - 32768);
  }
}

/// @return sum of the magnitudes, each at most `limit`; adds to `cells`
OMNIFLEET_WIDE std::int64_t takeValues(const std::int16_t* raw, const std::int16_t* fixed,
                                       const std::uint8_t* used, int limit, int n, std::int16_t* values,
                                       int& cells) {
  std::int32_t sum = 0, count = 0;
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const std::int32_t value = raw[i] - fixed[i];
    const std::int32_t kept = used[i] != 0 ? value : 0;
    values[i] = static_cast<std::int16_t>(used[i] != 0 ? value : FloorRaster::kNone);
    const std::int32_t magnitude = kept < 0 ? -kept : kept;
    sum += magnitude < limit ? magnitude : limit;
    count += used[i] != 0 ? 1 : 0;
  }
  cells += count;
  return sum;
}

OMNIFLEET_WIDE void pairRows(const std::int16_t* row, const std::int16_t* next, int n, std::int32_t* pairs) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i)
    pairs[i] = static_cast<std::int32_t>(static_cast<std::uint32_t>(next[i]) << 16 |
                                         static_cast<std::uint16_t>(row[i]));
}

OMNIFLEET_WIDE void addToMean(const std::int16_t* raw, const std::uint8_t* used, int n, float* mean,
                              float* weights) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const float weight = weights[i] + 1.0f < kMemory ? weights[i] + 1.0f : kMemory;
    const float next = mean[i] + (static_cast<float>(raw[i]) - mean[i]) / weight;
    mean[i] = used[i] != 0 ? next : mean[i];
    weights[i] = used[i] != 0 ? weight : weights[i];
  }
}

/// Positive-part James–Stein estimate per cell. `variance` is that of one raster's texture.
OMNIFLEET_WIDE void shrink(const float* mean, const float* weights, float variance, int n,
                           std::int16_t* fixed) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) {
    const float square = mean[i] * mean[i] * weights[i] + 1e-3f;
    const float share = 1.0f - kChance * variance / square;
    const bool known = weights[i] >= kFewest && share > 0.0f;
    fixed[i] = static_cast<std::int16_t>(known ? mean[i] * share : 0.0f);
  }
}

}  // namespace

FloorRaster::FloorRaster(const lens::Camera& camera, const FloorView& view, double inner_m, double outer_m,
                         double cell_m)
    : image_size_(view.imageSize()) {
  const int across = 2 * (static_cast<int>(std::ceil(outer_m / cell_m)) + kMargin - 1);
  side_ = (across + kBlock - 1) / kBlock * kBlock;
  half_ = side_ / 2;
  base_ = Eigen::Vector2d::Constant(0.5 * (side_ - 1)) - camera.foot() / cell_m;
  const cv::Size size(side_, side_), half(half_, half_), padded(half_ + 2 * kWide, half_ + 2 * kWide);
  for (cv::Mat1b* mat : {&inside_, &inner_, &floor_, &used_, &blocked_, &dilated_})
    *mat = cv::Mat1b(size, std::uint8_t{0});
  addCells(camera, view, inner_m, outer_m, cell_m);
  if (index_.empty())
    throw options::Error(
        "floor_alignment: no cell shows floor; check inner_m, outer_m and self_mask_radius_px");
  grey_ = cv::Mat1w(size, std::uint16_t{0});
  for (cv::Mat1f* mat : {&sums_, &counts_}) *mat = cv::Mat1f(half, 0.0f);
  scale_ = cv::Mat1f(half, 0.0f);
  for (cv::Mat1f* mat : {&buffer_, &other_buffer_}) *mat = cv::Mat1f(padded, 0.0f);
  for (cv::Mat1s* mat : {&raw_, &fixed_}) *mat = cv::Mat1s(size, std::int16_t{0});
  for (cv::Mat1f* mat : {&mean_, &weights_}) *mat = cv::Mat1f(size, 0.0f);
  values_ = cv::Mat1s(size, kNone);
  pairs_ = cv::Mat1i(size, 0);
  rows_.assign(static_cast<std::size_t>(6 * side_), 0.0f);
  stage_.resize(static_cast<std::size_t>(3 * taps_ * kChunk));
  brightness_.resize(kChunk);
}

/// A cell that can show floor.
struct FloorRaster::Cell {
  int index = 0;
  Eigen::Vector2f pixel, along, across;  ///< middle and sides in the image
};

void FloorRaster::addCells(const lens::Camera& camera, const FloorView& view, double inner_m, double outer_m,
                           double cell_m) {
  const cv::Rect allowed(2, 2, image_size_.width - 4, image_size_.height - 4);
  const auto pixelAt = [&](double x, double y) {
    const Eigen::Vector2d floor = (Eigen::Vector2d(x, y) - base_) * cell_m;
    return camera.pixelFromPoint({floor.x(), floor.y(), 0.0});
  };
  std::vector<Cell> cells;
  for (int y = kMargin; y < side_ - kMargin; ++y) {
    for (int x = kMargin; x < side_ - kMargin; ++x) {
      const double range_m = std::hypot(x - 0.5 * (side_ - 1), y - 0.5 * (side_ - 1)) * cell_m;
      if (range_m < inner_m || range_m > outer_m) continue;
      const auto at = pixelAt(x, y), left = pixelAt(x - 0.5, y), right = pixelAt(x + 0.5, y),
                 low = pixelAt(x, y - 0.5), high = pixelAt(x, y + 0.5);
      if (!at || !left || !right || !low || !high) continue;
      const cv::Point nearest(cvRound(at->x()), cvRound(at->y()));
      if (!allowed.contains(nearest) || view.mask()(nearest) == 0) continue;
      inside_(y, x) = 1;
      cells.push_back(
          {y * side_ + x, at->cast<float>(), (*right - *left).cast<float>(), (*high - *low).cast<float>()});
    }
  }
  blocked_ = inside_ == 0;
  cv::Mat1b outside(inside_.size(), std::uint8_t{1});
  dilateMargin(blocked_, dilated_, outside);
  exclude(inside_.ptr(), outside.ptr(), side_ * side_, inner_.ptr());
  blocked_.setTo(0);
  if (!cells.empty()) chooseTaps(cells);
}

/// One, two or four positions per cell, by the number of pixels that most cells cover.
void FloorRaster::chooseTaps(const std::vector<Cell>& cells) {
  std::vector<float> lengths;
  for (const Cell& cell : cells) lengths.push_back(std::max(cell.along.norm(), cell.across.norm()));
  const auto middle = lengths.begin() + static_cast<std::ptrdiff_t>(lengths.size() / 2);
  std::nth_element(lengths.begin(), middle, lengths.end());
  taps_ = *middle < 1.0f ? 1 : *middle < 2.5f ? 2 : 4;
  const float right = static_cast<float>(image_size_.width) - 4.01f,  // gather() reads four bytes

      bottom = static_cast<float>(image_size_.height) - 2.01f;
  for (const Cell& cell : cells) {
    index_.push_back(cell.index);
    pixels_.emplace_back(cell.pixel.x(), cell.pixel.y());
    const Eigen::Vector2f longer = cell.along.norm() > cell.across.norm() ? cell.along : cell.across;
    for (int k = 0; k < taps_; ++k) {
      const float one = k % 2 == 0 ? -0.25f : 0.25f, other = k / 2 == 0 ? -0.25f : 0.25f;
      Eigen::Vector2f off = Eigen::Vector2f::Zero();
      if (taps_ == 2) off = one * longer;
      if (taps_ == 4) off = one * cell.along + other * cell.across;
      const float u = std::clamp(cell.pixel.x() + off.x(), 0.0f, right),
                  v = std::clamp(cell.pixel.y() + off.y(), 0.0f, bottom);
      tap_pixels_.emplace_back(std::floor(u), std::floor(v));
      tap_shares_.push_back(static_cast<std::uint16_t>(cvRound(128.0f * (u - std::floor(u))) |
                                                       cvRound(128.0f * (v - std::floor(v))) << 8));
    }
  }
}

void FloorRaster::make(const cv::Mat& image, const cv::Mat1b& objects) {
  CV_Assert(image.size() == image_size_ && (image.type() == CV_8UC1 || image.type() == CV_8UC3));
  CV_Assert(objects.empty() || objects.size() == image_size_);
  findOffsets(image, objects);
  sample(image);
  markObjects(objects);
  findWide();
  findNarrow();
  finish();
}

/// The offsets depend on the layout of the caller's memory, which rarely changes.
void FloorRaster::findOffsets(const cv::Mat& image, const cv::Mat1b& objects) {
  if (image_step_ != image.step[0] || channels_ != image.channels()) {
    image_step_ = image.step[0];
    channels_ = image.channels();
    tap_offsets_.clear();
    const int green = channels_ == 1 ? 0 : 1;
    for (const cv::Point2f& at : tap_pixels_)
      tap_offsets_.push_back(cvRound(at.y) * static_cast<int>(image_step_) + cvRound(at.x) * channels_ +
                             green);
  }
  if (objects.empty() || object_step_ == objects.step[0]) return;
  object_step_ = objects.step[0];
  object_offsets_.clear();
  for (const cv::Point2f& at : pixels_)
    object_offsets_.push_back(cvRound(at.y) * static_cast<int>(object_step_) + cvRound(at.x));
}

void FloorRaster::sample(const cv::Mat& image) {
  std::uint32_t *top = stage_.data(), *bottom = top + taps_ * kChunk, *mixed = bottom + taps_ * kChunk;
  auto* grey = grey_.ptr<std::uint16_t>();
  const int cells = static_cast<int>(index_.size()), second_bit = channels_ == 1 ? 8 : 24;
  for (int first = 0; first < cells; first += kChunk) {
    const int n = std::min(kChunk, cells - first);
    const auto tap = static_cast<std::size_t>(first * taps_);
    gather(image.data, image_step_, tap_offsets_.data() + tap, n * taps_, top, bottom);
    mixTaps(top, bottom, second_bit, tap_shares_.data() + tap, n * taps_, mixed);
    (taps_ == 1 ? meanOfOne : taps_ == 2 ? meanOfTwo : meanOfFour)(mixed, n, brightness_.data());
    const std::int32_t* index = index_.data() + first;
    for (int i = 0; i < n; ++i) grey[index[i]] = brightness_[static_cast<std::size_t>(i)];
  }
}

void FloorRaster::markObjects(const cv::Mat1b& objects) {
  const int n = side_ * side_;
  std::uint8_t any = 0;
  if (!objects.empty()) {
    std::uint8_t* blocked = blocked_.ptr();
    for (std::size_t i = 0; i < index_.size(); ++i)
      any |= blocked[index_[i]] = objects.data[object_offsets_[i]];
  }
  if (any == 0) {
    inside_.copyTo(floor_);
    inner_.copyTo(used_);
    return;
  }
  dilateObjects(blocked_, dilated_, used_);
  exclude(inside_.ptr(), used_.ptr(), n, floor_.ptr());
  used_.copyTo(blocked_);
  dilateMargin(blocked_, dilated_, used_);
  exclude(inner_.ptr(), used_.ptr(), n, used_.ptr());
}

/// The wide mean from cells of double size. Its steps between them vanish in findNarrow().
void FloorRaster::findWide() {
  static const Kernel kKernel = wideKernel();
  for (int y = 0; y < half_; ++y)
    sumFour(grey_.ptr<std::uint16_t>(2 * y), floor_.ptr(2 * y), side_, half_, sums_.ptr<float>(y),
            counts_.ptr<float>(y));
  const std::ptrdiff_t step = buffer_.cols;
  const auto smooth = [&](const cv::Mat1f& in) {  // result in other_buffer_, from its upper left corner
    for (int y = 0; y < half_; ++y)
      std::copy_n(in.ptr<float>(y), half_, buffer_.ptr<float>(y + kWide) + kWide);
    for (int y = kWide; y < half_ + kWide; ++y)
      convolve(buffer_.ptr<float>(y) + kWide, 1, kKernel, half_, other_buffer_.ptr<float>(y));
    for (int y = 0; y < half_; ++y)
      convolve(other_buffer_.ptr<float>(y + kWide), step, kKernel, half_,
               buffer_.ptr<float>(y + kWide) + kWide);
  };
  smooth(sums_);
  for (int y = 0; y < half_; ++y)
    std::copy_n(buffer_.ptr<float>(y + kWide) + kWide, half_, scale_.ptr<float>(y));
  smooth(counts_);
  for (int y = 0; y < half_; ++y)
    invert(scale_.ptr<float>(y), buffer_.ptr<float>(y + kWide) + kWide, half_, scale_.ptr<float>(y));
}

void FloorRaster::findNarrow() {
  std::array<const float*, 5> rows{};
  float* contrast = rows_.data() + 5 * side_;
  for (int y = 0; y < side_; ++y) {
    contrastOfRow(grey_.ptr<std::uint16_t>(y), floor_.ptr(y), scale_.ptr<float>(y / 2), side_, contrast,
                  rows_.data() + y % 5 * side_);
    if (y < 4) continue;
    for (int k = 0; k < 5; ++k) rows[static_cast<std::size_t>(k)] = rows_.data() + (y - 4 + k) % 5 * side_;
    smoothAcross(rows.data(), side_, raw_.ptr<std::int16_t>(y - 2));
  }
}

void FloorRaster::finish() {
  const int limit = contrast_ > 0.0f ? std::max(kLeastLimit, cvRound(kStrong * contrast_)) : 1 << 15;
  std::int64_t sum = 0;
  cells_ = 0;
  for (int y = 0; y < side_; ++y) {
    sum += takeValues(raw_.ptr<std::int16_t>(y), fixed_.ptr<std::int16_t>(y), used_.ptr(y), limit, side_,
                      values_.ptr<std::int16_t>(y), cells_);
    if (y > 0)
      pairRows(values_.ptr<std::int16_t>(y - 1), values_.ptr<std::int16_t>(y), side_,
               pairs_.ptr<std::int32_t>(y - 1));
  }
  contrast_ = cells_ > 0 ? static_cast<float>(sum) / static_cast<float>(cells_) : 0.0f;
}

void FloorRaster::learnFixed() {
  const int n = side_ * side_;
  addToMean(raw_.ptr<std::int16_t>(), used_.ptr(), n, mean_.ptr<float>(), weights_.ptr<float>());
  const float sigma = 1.25f * contrast_;
  shrink(mean_.ptr<float>(), weights_.ptr<float>(), sigma * sigma, n, fixed_.ptr<std::int16_t>());
}

void FloorRaster::makeCoarse(cv::Mat1f& coarse) const {
  const int n = half_ / 2;
  if (coarse.empty()) coarse = cv::Mat1f(n + 2 * kCoarseBorder, n + 2 * kCoarseBorder, 0.0f);
  for (int y = 0; y < n; ++y) {
    for (int x = 0; x < n; ++x) {
      float sum = 0.0f;
      for (int k = 0; k < 4; ++k) {
        const int v = 2 * y + k / 2, u = 2 * x + k % 2;
        sum += sums_(v, u) * scale_(v, u) - counts_(v, u);
      }
      coarse(y + kCoarseBorder, x + kCoarseBorder) = sum * (1.0f / 16.0f);
    }
  }
}

}  // namespace omnifleet::ground
