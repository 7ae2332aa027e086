#include "flow/harris.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <tuple>

#include "geometry/wide.h"

namespace omnifleet::flow {

HarrisOptions HarrisOptions::read(const options::Section& section) {
  HarrisOptions o;
  section.read("k", o.k, {0.0, 0.25});
  section.read("m", o.m, {0.0, 1.0});
  section.read("per_label", o.per_label);
  section.read("sigma_px", o.sigma_px, {0.5, 5.0});
  section.read("max_per_label", o.max_per_label, {1, 1000});
  section.read("min_distance_px", o.min_distance_px, {1.0, 100.0});
  section.read("halve_from_px", o.halve_from_px, {0, 100000000});
  section.finish();
  return o;
}

Harris::Harris(const HarrisOptions& options)
    : options_(options),
      kernel_(gaussian(options.sigma_px)),
      half_kernel_(gaussian(0.5 * options.sigma_px)) {}

std::vector<float> Harris::gaussian(double sigma_px) {
  const int radius = static_cast<int>(std::ceil(2.0 * sigma_px));
  std::vector<float> weights;
  double sum = 0.0;
  for (int i = -radius; i <= radius; ++i) {
    const double w = std::exp(-0.5 * i * i / (sigma_px * sigma_px));
    weights.push_back(static_cast<float>(w));
    sum += w;
  }
  for (float& w : weights) w = static_cast<float>(w / sum);
  return weights;
}

namespace {

constexpr int kChunk = 16;

/// From the first to the last column of both. An empty range is ignored.
cv::Range joined(const cv::Range& a, const cv::Range& b) {
  if (a.empty()) return b;
  if (b.empty()) return a;
  return {std::min(a.start, b.start), std::max(a.end, b.end)};
}

void growTo(cv::Mat1f& m, int rows, int columns) {
  if (m.rows < rows || m.cols < columns) m.create(std::max(m.rows, rows), std::max(m.cols, columns));
}

/// Products of the central differences over n pixels of an image row.
OMNIFLEET_WIDE void differentiate(const std::uint8_t* above, const std::uint8_t* here,
                                  const std::uint8_t* below, int n, float* xx, float* xy, float* yy) {
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        const float dx = 0.5f * static_cast<float>(here[x + 1] - here[x - 1]);
        const float dy = 0.5f * static_cast<float>(below[x] - above[x]);
        xx[x] = dx * dx;
        xy[x] = dx * dy;
        yy[x] = dy * dy;
      });
}

/// Σ w[t] · in[x + t · step] over 2·kRadius + 1 taps, w symmetric.
template <int kRadius>
inline __attribute__((always_inline)) void smoothAlong(const float* w, const float* in, std::ptrdiff_t step,
                                                       int n, float* out) {
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        float sum = w[kRadius] * in[x + kRadius * step];
        for (int t = 0; t < kRadius; ++t) sum += w[t] * (in[x + t * step] + in[x + (2 * kRadius - t) * step]);
        out[x] = sum;
      });
}

/// Smooths along columns first, then along rows. The valid area shrinks by the window and moves to the top
/// left.
/// @param spans requested columns of each row of the result
template <int kRadius>
inline __attribute__((always_inline)) void smoothBothWays(const float* weights, cv::Mat1f& product,
                                                          const std::vector<cv::Range>& spans,
                                                          float* middle) {
  float w[kRadius + 1];
  std::copy(weights, weights + kRadius + 1, w);
  const auto step = static_cast<std::ptrdiff_t>(product.step1());
  int y = 0;
  for (const cv::Range& span : spans) {
    float* row = product.ptr<float>(y++) + span.start;
    if (span.empty()) continue;
    smoothAlong<kRadius>(w, row, step, span.size() + 2 * kRadius, middle);
    smoothAlong<kRadius>(w, middle, 1, span.size(), row);
  }
}

OMNIFLEET_WIDE void smoothProduct(const float* weights, int radius, cv::Mat1f& product,
                                  const std::vector<cv::Range>& spans, float* middle) {
  switch (radius) {
    case 1:
      return smoothBothWays<1>(weights, product, spans, middle);
    case 2:
      return smoothBothWays<2>(weights, product, spans, middle);
    case 3:
      return smoothBothWays<3>(weights, product, spans, middle);
    case 4:
      return smoothBothWays<4>(weights, product, spans, middle);
    case 5:
      return smoothBothWays<5>(weights, product, spans, middle);
    case 6:
      return smoothBothWays<6>(weights, product, spans, middle);
    case 7:
      return smoothBothWays<7>(weights, product, spans, middle);
    case 8:
      return smoothBothWays<8>(weights, product, spans, middle);
    case 9:
      return smoothBothWays<9>(weights, product, spans, middle);
    default:
      return smoothBothWays<10>(weights, product, spans, middle);
  }
}

/// O(x, y) of eq. 2.
OMNIFLEET_WIDE void combine(const float* xx, const float* xy, const float* yy, float k, int n, float* out) {
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        const float trace = xx[x] + yy[x];
        out[x] = xx[x] * yy[x] - xy[x] * xy[x] - k * trace * trace;
      });
}

/// 1 where the response is positive and a maximum of its 3×3 neighbourhood (the first of equal values), else
/// 0.
OMNIFLEET_WIDE void findPeaks(const float* above, const float* here, const float* below, int begin, int end,
                              int* peaks) {
  inChunks<kChunk>(
      begin, end, [=](int x) __attribute__((always_inline)) {
        const float r = here[x];
        const int above_all = (r > above[x - 1]) & (r > above[x]) & (r > above[x + 1]) & (r > here[x - 1]);
        const int below_none =
            (r >= below[x - 1]) & (r >= below[x]) & (r >= below[x + 1]) & (r >= here[x + 1]);
        peaks[x] = above_all & below_none & (r > 0.0f);
      });
}

}  // namespace

void Harris::response(const cv::Mat1b& grey, const cv::Rect& rect, cv::Mat1f& response) {
  spans_.assign(static_cast<std::size_t>(rect.height), {0, rect.width});
  respond(grey, rect, kernel_, response);
}

/// Per row, the columns of the rectangle that peak detection needs: those of the blob and one pixel around
/// it.
void Harris::findSpans(const ground::Blob& blob, const cv::Rect& rect) {
  spans_.assign(static_cast<std::size_t>(rect.height), {0, 0});
  for (const ground::Run& run : blob.runs) {
    const cv::Range columns(std::max(0, run.begin - 1 - rect.x), std::min(rect.width, run.end + 1 - rect.x));
    const int row = run.row - rect.y;
    for (int y = std::max(0, row - 1); y <= std::min(rect.height - 1, row + 1); ++y) {
      cv::Range& span = spans_[static_cast<std::size_t>(y)];
      span = joined(span, columns);
    }
  }
}

/// Computes the response in the spans; elsewhere `response` is undefined.
void Harris::respond(const cv::Mat1b& grey, const cv::Rect& rect, const std::vector<float>& kernel,
                     cv::Mat1f& response) {
  const int radius = static_cast<int>(kernel.size()) / 2;
  const int rows = rect.height + 2 * radius, columns = rect.width + 2 * radius;
  for (cv::Mat1f* m : {&xx_, &xy_, &yy_, &row_}) growTo(*m, rows, columns);
  growTo(response, rect.height, rect.width);
  for (int y = 0; y < rows; ++y) {
    cv::Range span(0, 0);
    for (int k = std::max(0, y - 2 * radius); k <= std::min(y, rect.height - 1); ++k)
      span = joined(span, spans_[static_cast<std::size_t>(k)]);
    if (!span.empty()) takeProducts(grey, rect, radius, y, {span.start, span.end + 2 * radius});
  }
  for (cv::Mat1f* product : {&xx_, &xy_, &yy_})
    smoothProduct(kernel.data(), radius, *product, spans_, row_.ptr<float>(0));
  for (int y = 0; y < rect.height; ++y) {
    const cv::Range& span = spans_[static_cast<std::size_t>(y)];
    const auto at = [y, &span](cv::Mat1f& m) { return m.ptr<float>(y) + span.start; };
    if (!span.empty())
      combine(at(xx_), at(xy_), at(yy_), static_cast<float>(options_.k), span.size(), at(response));
  }
}

/// Products for row y of the rectangle, which is extended by the radius of the window, in some of its
/// columns. Beyond the edge of the image, rows are repeated and columns are 0.
void Harris::takeProducts(const cv::Mat1b& grey, const cv::Rect& rect, int radius, int y,
                          const cv::Range& columns) {
  const int u0 = rect.x - radius;
  const int first = std::clamp(1 - u0, columns.start, columns.end),
            last = std::clamp(grey.cols - 1 - u0, first, columns.end);
  const int v = std::clamp(rect.y + y - radius, 1, grey.rows - 2), u = u0 + first;
  float *xx = xx_.ptr<float>(y), *xy = xy_.ptr<float>(y), *yy = yy_.ptr<float>(y);
  differentiate(grey.ptr(v - 1) + u, grey.ptr(v) + u, grey.ptr(v + 1) + u, last - first, xx + first,
                xy + first, yy + first);
  for (float* product : {xx, xy, yy}) {
    std::fill(product + columns.start, product + first, 0.0f);
    std::fill(product + last, product + columns.end, 0.0f);
  }
}

void Harris::candidates(const ground::Blob& blob, std::size_t index, const cv::Rect& rect, int scale) {
  const std::size_t first = candidates_.size();
  peaks_.resize(std::max(peaks_.size(), static_cast<std::size_t>(rect.width)));
  for (const auto& run : blob.runs) {
    const int y = run.row - rect.y, begin = run.begin - rect.x, end = run.end - rect.x;
    if (y < 1 || y + 1 >= rect.height) continue;
    const float* here = response_.ptr<float>(y);
    findPeaks(response_.ptr<float>(y - 1), here, response_.ptr<float>(y + 1), begin, end, peaks_.data());
    for (int x = begin; x < end; ++x) {
      if (peaks_[static_cast<std::size_t>(x)] == 0) continue;
      const Eigen::Vector2f pixel(static_cast<float>(scale * (x + rect.x)),
                                  static_cast<float>(scale * run.row));
      candidates_.push_back({pixel, here[x], index});
      strongest_[index] = std::max(strongest_[index], here[x]);
    }
  }
  if (!options_.per_label) return;
  const float threshold = static_cast<float>(options_.m) * strongest_[index];
  const auto begin = candidates_.begin() + static_cast<std::ptrdiff_t>(first);
  candidates_.erase(
      std::remove_if(begin, candidates_.end(), [&](const Corner& c) { return c.response < threshold; }),
      candidates_.end());
}

void Harris::select(std::size_t blobs) {
  const float frame_strongest =
      strongest_.empty() ? 0.0f : *std::max_element(strongest_.begin(), strongest_.end());
  std::sort(candidates_.begin(), candidates_.end(), [](const Corner& a, const Corner& b) {
    return std::make_tuple(a.blob, -a.response, a.pixel.y(), a.pixel.x()) <
           std::make_tuple(b.blob, -b.response, b.pixel.y(), b.pixel.x());
  });
  const auto distance = static_cast<float>(options_.min_distance_px);
  std::size_t next = 0;
  for (std::size_t blob = 0; blob < blobs; ++blob) {
    const std::size_t begin = corners_.size();
    const float strongest = options_.per_label ? strongest_[blob] : frame_strongest;
    const float threshold = static_cast<float>(options_.m) * strongest;
    for (; next < candidates_.size() && candidates_[next].blob == blob; ++next) {
      const Corner& corner = candidates_[next];
      if (corner.response < threshold) continue;
      if (corners_.size() - begin >= static_cast<std::size_t>(options_.max_per_label)) continue;
      const bool near = std::any_of(
          corners_.begin() + static_cast<std::ptrdiff_t>(begin), corners_.end(),
          [&](const Corner& c) { return (c.pixel - corner.pixel).squaredNorm() < distance * distance; });
      if (!near) corners_.push_back(corner);
    }
  }
}

const std::vector<Corner>& Harris::detect(const cv::Mat1b& grey, const std::vector<ground::Blob>& blobs) {
  all_.resize(blobs.size());
  std::iota(all_.begin(), all_.end(), std::size_t{0});
  return detect(grey, cv::Mat1b(), blobs, all_);
}

const std::vector<Corner>& Harris::detect(const cv::Mat1b& grey, const cv::Mat1b& half,
                                          const std::vector<ground::Blob>& blobs,
                                          const std::vector<std::size_t>& which) {
  candidates_.clear();
  corners_.clear();
  strongest_.assign(which.size(), 0.0f);
  const bool halve = !half.empty() && options_.per_label && options_.halve_from_px > 0;
  for (std::size_t n = 0; n < which.size(); ++n) {
    const ground::Blob& blob = blobs[which[n]];
    if (halve && blob.area_px >= options_.halve_from_px)
      findIn(half, halved(blob), n, 2);
    else
      findIn(grey, blob, n, 1);
  }
  select(which.size());
  return corners_;
}

/// The pixels of a region at half the resolution, where pixel x corresponds to 2x.
const ground::Blob& Harris::halved(const ground::Blob& blob) {
  halved_.runs.clear();
  for (const ground::Run& run : blob.runs) {
    const ground::Run half{run.row / 2, (run.begin + 1) / 2, (run.end + 1) / 2};
    if (run.row % 2 == 0 && half.begin < half.end) halved_.runs.push_back(half);
  }
  const cv::Rect& r = blob.rect;
  const cv::Point first((r.x + 1) / 2, (r.y + 1) / 2);
  halved_.rect = {first, cv::Point((r.x + r.width + 1) / 2, (r.y + r.height + 1) / 2)};
  return halved_;
}

/// @param scale pixels of the full resolution per pixel of `grey`
void Harris::findIn(const cv::Mat1b& grey, const ground::Blob& blob, std::size_t index, int scale) {
  const cv::Rect& r = blob.rect;
  if (r.x < 1 || r.y < 1 || r.x + r.width >= grey.cols || r.y + r.height >= grey.rows) return;
  const cv::Rect rect =
      cv::Rect(r.x - 1, r.y - 1, r.width + 2, r.height + 2) & cv::Rect(0, 0, grey.cols, grey.rows);
  findSpans(blob, rect);
  respond(grey, rect, scale == 1 ? kernel_ : half_kernel_, response_);
  candidates(blob, index, rect, scale);
}

}  // namespace omnifleet::flow
