#include "flow/harris.h"

#include <algorithm>
#include <cmath>
#include <tuple>

namespace omnifleet::flow {

HarrisOptions HarrisOptions::read(const options::Section& section) {
  HarrisOptions o;
  section.read("k", o.k, {0.0, 0.25});
  section.read("m", o.m, {0.0, 1.0});
  section.read("per_label", o.per_label);
  section.read("sigma_px", o.sigma_px, {0.5, 5.0});
  section.read("max_per_label", o.max_per_label, {1, 1000});
  section.read("min_distance_px", o.min_distance_px, {1.0, 100.0});
  section.finish();
  return o;
}

Harris::Harris(const HarrisOptions& options) : options_(options) {
  const int radius = static_cast<int>(std::ceil(2.0 * options.sigma_px));
  double sum = 0.0;
  for (int i = -radius; i <= radius; ++i) {
    const double w = std::exp(-0.5 * i * i / (options.sigma_px * options.sigma_px));
    kernel_.push_back(static_cast<float>(w));
    sum += w;
  }
  for (float& w : kernel_) w = static_cast<float>(w / sum);
}

namespace {

void growTo(cv::Mat1f& m, int rows, int columns) {
  if (m.rows < rows || m.cols < columns) m.create(std::max(m.rows, rows), std::max(m.cols, columns));
}

}  // namespace

void Harris::smoothProducts(int rows, int columns) {
  switch (kernel_.size() / 2) {
    case 1:
      return smoothWith<1>(rows, columns);
    case 2:
      return smoothWith<2>(rows, columns);
    case 3:
      return smoothWith<3>(rows, columns);
    case 4:
      return smoothWith<4>(rows, columns);
    case 5:
      return smoothWith<5>(rows, columns);
    case 6:
      return smoothWith<6>(rows, columns);
    case 7:
      return smoothWith<7>(rows, columns);
    case 8:
      return smoothWith<8>(rows, columns);
    case 9:
      return smoothWith<9>(rows, columns);
    default:
      return smoothWith<10>(rows, columns);
  }
}

template <int kRadius>
void Harris::smoothWith(int rows, int columns) {
  // Columns first, then rows; the valid part shrinks by the window and moves to the top left.
  constexpr int kTaps = 2 * kRadius + 1;
  float w[kTaps] = {};
  for (std::size_t t = 0; t < kernel_.size(); ++t) w[t + (kTaps - kernel_.size()) / 2] = kernel_[t];
  for (cv::Mat1f* product : {&xx_, &xy_, &yy_}) {
    const std::ptrdiff_t step = static_cast<std::ptrdiff_t>(product->step1());
    float* middle = row_.ptr<float>(0);
    for (int y = 0; y + kTaps <= rows; ++y) {
      const float* in = product->ptr<float>(y);
      for (int x = 0; x < columns; ++x) {
        float sum = w[kRadius] * in[x + kRadius * step];
        for (int t = 0; t < kRadius; ++t) sum += w[t] * (in[x + t * step] + in[x + (kTaps - 1 - t) * step]);
        middle[x] = sum;
      }
      float* out = product->ptr<float>(y);
      for (int x = 0; x + kTaps <= columns; ++x) {
        float sum = w[kRadius] * middle[x + kRadius];
        for (int t = 0; t < kRadius; ++t) sum += w[t] * (middle[x + t] + middle[x + kTaps - 1 - t]);
        out[x] = sum;
      }
    }
  }
}

void Harris::response(const cv::Mat1b& grey, const cv::Rect& rect, cv::Mat1f& response) {
  const int radius = static_cast<int>(kernel_.size()) / 2;
  const int rows = rect.height + 2 * radius, columns = rect.width + 2 * radius;
  for (cv::Mat1f* m : {&xx_, &xy_, &yy_, &row_}) growTo(*m, rows, columns);
  growTo(response, rect.height, rect.width);
  for (int y = 0; y < rows; ++y) {
    const int v = std::clamp(rect.y + y - radius, 1, grey.rows - 2);
    const std::uint8_t *above = grey.ptr(v - 1), *here = grey.ptr(v), *below = grey.ptr(v + 1);
    float *xx = xx_.ptr<float>(y), *xy = xy_.ptr<float>(y), *yy = yy_.ptr<float>(y);
    const int u0 = rect.x - radius;
    const int first = std::max(0, 1 - u0), last = std::min(columns, grey.cols - 1 - u0);
    for (int x = first; x < last; ++x) {
      const int u = u0 + x;
      const float dx = 0.5f * static_cast<float>(here[u + 1] - here[u - 1]);
      const float dy = 0.5f * static_cast<float>(below[u] - above[u]);
      xx[x] = dx * dx;
      xy[x] = dx * dy;
      yy[x] = dy * dy;
    }
    for (float* product : {xx, xy, yy}) {
      std::fill(product, product + first, 0.0f);
      std::fill(product + last, product + columns, 0.0f);
    }
  }
  smoothProducts(rows, columns);
  const auto k = static_cast<float>(options_.k);
  for (int y = 0; y < rect.height; ++y) {
    const float *xx = xx_.ptr<float>(y), *xy = xy_.ptr<float>(y), *yy = yy_.ptr<float>(y);
    float* out = response.ptr<float>(y);
    for (int x = 0; x < rect.width; ++x) {
      const float trace = xx[x] + yy[x];
      out[x] = xx[x] * yy[x] - xy[x] * xy[x] - k * trace * trace;
    }
  }
}

void Harris::candidates(const ground::Blob& blob, std::size_t index, const cv::Rect& rect) {
  for (const auto& run : blob.runs) {
    const int y = run.row - rect.y;
    if (y < 1 || y + 1 >= rect.height) continue;
    const float *above = response_.ptr<float>(y - 1), *here = response_.ptr<float>(y),
                *below = response_.ptr<float>(y + 1);
    for (int x = run.begin - rect.x; x < run.end - rect.x; ++x) {
      const float r = here[x];
      if (r <= 0.0f || r <= here[x - 1] || r < here[x + 1]) continue;
      if (r <= above[x - 1] || r <= above[x] || r <= above[x + 1]) continue;
      if (r < below[x - 1] || r < below[x] || r < below[x + 1]) continue;
      candidates_.push_back(
          {Eigen::Vector2f(static_cast<float>(x + rect.x), static_cast<float>(run.row)), r, index});
      strongest_[index] = std::max(strongest_[index], r);
    }
  }
}

void Harris::select(const std::vector<ground::Blob>& blobs) {
  const float frame_strongest =
      strongest_.empty() ? 0.0f : *std::max_element(strongest_.begin(), strongest_.end());
  std::sort(candidates_.begin(), candidates_.end(), [](const Corner& a, const Corner& b) {
    return std::make_tuple(a.blob, -a.response, a.pixel.y(), a.pixel.x()) <
           std::make_tuple(b.blob, -b.response, b.pixel.y(), b.pixel.x());
  });
  const auto distance = static_cast<float>(options_.min_distance_px);
  std::size_t next = 0;
  for (std::size_t blob = 0; blob < blobs.size(); ++blob) {
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
  candidates_.clear();
  corners_.clear();
  strongest_.assign(blobs.size(), 0.0f);
  const cv::Rect image(0, 0, grey.cols, grey.rows);
  for (std::size_t n = 0; n < blobs.size(); ++n) {
    const cv::Rect& r = blobs[n].rect;
    if (r.x < 1 || r.y < 1 || r.x + r.width >= grey.cols || r.y + r.height >= grey.rows) continue;
    const cv::Rect rect = cv::Rect(r.x - 1, r.y - 1, r.width + 2, r.height + 2) & image;
    response(grey, rect, response_);
    candidates(blobs[n], n, rect);
  }
  select(blobs);
  return corners_;
}

}  // namespace omnifleet::flow
