#include "flow/pyramid.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

#include "geometry/lanes.h"

namespace omnifleet::flow {

namespace {

constexpr int kChunk = 32;

/// Mirrors pixels beyond the border without repeating the outermost one (BORDER_REFLECT_101).
int mirrored(int i, int size) {
  return i < 0 ? -i : i >= size ? 2 * size - 2 - i : i;
}

using Pairs = std::uint16_t
    __attribute__((vector_size(32)));  // sixteen pairs of two pixels, the left pixel in the low byte
static_assert(__BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__);

/// 1 4 6 4 1 along a row, at its pixels 2 (first + x), x from 0 to n. Pixels are read as pairs in place.
/// Splitting rows into even and odd pixels first would stall, because they would be read back before they are
/// written.
OMNIFLEET_WIDE void smoothRow(const std::uint8_t* in, int width, int first, int n, std::uint16_t* out) {
  constexpr int kPairs = 16;
  const auto sixteenFrom = [=](int x) __attribute__((always_inline)) {
    const std::uint8_t* at = in + 2 * (first + x);
    const auto before = lanes::load<Pairs>(at - 2), here = lanes::load<Pairs>(at),
               after = lanes::load<Pairs>(at + 2);
    const Pairs sum = (before & 255) + (after & 255) + 4 * ((before >> 8) + (here >> 8)) + 6 * (here & 255);
    lanes::store(sum, out + x);
  };
  const auto one = [=](int x) {
    const auto at = [=](int step) { return in[mirrored(2 * (first + x) + step, width)]; };
    out[x] = static_cast<std::uint16_t>(at(-2) + at(2) + 4 * (at(-1) + at(1)) + 6 * at(0));
  };
  const int begin = first == 0 ? 1 : 0,
            end = std::min(n, width / 2 - 1 - first);  // the end of the pairs that lie entirely in the row
  int x = 0;
  for (; x < std::min(begin, n); ++x) one(x);
  if (end - begin >= kPairs) {
    for (; x < end - kPairs; x += kPairs) sixteenFrom(x);
    sixteenFrom(end - kPairs);
    x = end;
  }
  for (; x < n; ++x) one(x);
}

/// The same weights over five such rows; the sum of all weights is 256.
OMNIFLEET_WIDE void smoothColumns(const std::array<const std::uint16_t*, 5>& rows, int n, std::uint8_t* out) {
  const std::uint16_t *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3], *e = rows[4];
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        const auto sum = static_cast<std::uint16_t>(a[x] + e[x] + 4 * (b[x] + d[x]) + 6 * c[x] + 128);
        out[x] = static_cast<std::uint8_t>(sum >> 8);
      });
}

/// Brightness of n BGR pixels (BT.601), bit by bit equal to cv::cvtColor.
OMNIFLEET_WIDE void takeGreys(const std::uint8_t* pixels, int n, std::uint8_t* greys) {
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        const std::uint8_t* p = pixels + 3 * x;
        greys[x] = static_cast<std::uint8_t>((3735 * p[0] + 19235 * p[1] + 9798 * p[2] + (1 << 14)) >> 15);
      });
}

/// Prefetches bytes that are read a few rows later. The processor does not anticipate short rows in different
/// pages.
void prefetch(const std::uint8_t* bytes, int n) {
  constexpr int kLine = 64;
  for (int k = 0; k < n; k += kLine) __builtin_prefetch(bytes + k);
}

/// Brightness of n BGR colours (BT.601).
OMNIFLEET_WIDE void takeGreys(const float* colours, int n, std::uint8_t* greys) {
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        const float* c = colours + 3 * x;
        greys[x] = static_cast<std::uint8_t>(0.114f * c[0] + 0.587f * c[1] + 0.299f * c[2] + 0.5f);
      });
}

/// Range of pixels of the coarse row (or column) whose five pixels all lie in [begin, end) or beyond the
/// border.
cv::Range halved(int begin, int end, int size) {
  return {begin == 0 ? 0 : (begin + 3) / 2, end == size ? (size + 1) / 2 : (end - 1) / 2};
}

}  // namespace

void Pyramid::build(const cv::Mat& image) {
  build(image, {{0, 0, image.cols, image.rows}});
}

void Pyramid::build(const cv::Mat& image, const std::vector<cv::Rect>& where) {
  of_cells_ = false;
  create(image.size());
  build(image, where, levels_.size());
}

void Pyramid::build(const cv::Mat& image, const std::vector<cv::Rect>& where, const CellColours& cells,
                    const std::vector<cv::Rect>& around) {
  of_cells_ = levels_.size() > kCellLevel && !cells.means.empty();
  if (!of_cells_) return build(image, around);
  create(image.size());
  build(image, where, kCellLevel);
  for (const cv::Rect& rect : around) {
    cv::Rect taken = takeCells(cells, rect);
    for (std::size_t k = kCellLevel + 1; k < levels_.size() && !taken.empty(); ++k)
      taken = halve(levels_[k - 1], taken, levels_[k]);
  }
}

/// Beyond the known cells, the outermost ones are repeated: otherwise an artificial edge there would not move
/// with the image.
/// @param around rectangle of the finest level
/// @return rectangle of the cell level that was filled
cv::Rect Pyramid::takeCells(const CellColours& cells, const cv::Rect& around) {
  constexpr int kSide = CellColours::kSide;
  cv::Mat1b& level = levels_[kCellLevel];
  const cv::Point first(around.x / kSide, around.y / kSide),
      behind((around.x + around.width + kSide - 1) / kSide, (around.y + around.height + kSide - 1) / kSide);
  const cv::Rect rect = cv::Rect(first, behind) & cv::Rect({0, 0}, level.size());
  const int right = rect.x + rect.width;
  for (int y = rect.y; y < rect.y + rect.height; ++y) {
    const int row = std::min(y, cells.means.rows - 1);
    const cv::Range& known = cells.known[static_cast<std::size_t>(row)];
    std::uint8_t* to = level.ptr(y);
    const int begin = std::clamp(known.start, rect.x, right), end = std::clamp(known.end, begin, right);
    takeGreys(cells.means.ptr<float>(row) + 3 * begin, end - begin, to + begin);
    std::fill(to + rect.x, to + begin, begin < end ? to[begin] : std::uint8_t{0});
    std::fill(to + end, to + right, begin < end ? to[end - 1] : std::uint8_t{0});
  }
  return rect;
}

/// Builds the first `levels` levels.
void Pyramid::build(const cv::Mat& image, const std::vector<cv::Rect>& where, std::size_t levels) {
  for (cv::Rect rect : where) {
    if (rect.empty()) continue;
    if (image.channels() == 3)
      takeGreysOf(image, rect);
    else
      image(rect).copyTo(levels_[0](rect));
    for (std::size_t k = 1; k < levels && !rect.empty(); ++k) rect = halve(levels_[k - 1], rect, levels_[k]);
  }
}

void Pyramid::takeGreysOf(const cv::Mat& image, const cv::Rect& rect) {
  constexpr int kAhead = 4;  // rows to prefetch
  const int end = rect.y + rect.height;
  for (int y = rect.y; y < end; ++y) {
    if (y + kAhead < end) prefetch(image.ptr(y + kAhead) + 3 * rect.x, 3 * rect.width);
    takeGreys(image.ptr(y) + 3 * rect.x, rect.width, levels_[0].ptr(y) + rect.x);
  }
}

void Pyramid::create(cv::Size size) {
  for (cv::Mat1b& level : levels_) {
    if (level.size() != size) level = cv::Mat1b::zeros(size);
    size = {(size.width + 1) / 2, (size.height + 1) / 2};
  }
}

/// @param where rectangle of the fine level
/// @return rectangle of the coarse level that was filled
cv::Rect Pyramid::halve(const cv::Mat1b& fine, const cv::Rect& where, cv::Mat1b& coarse) {
  if (fine.cols < 4 || fine.rows < 4) {
    cv::pyrDown(fine, coarse);
    return {0, 0, coarse.cols, coarse.rows};
  }
  const cv::Range columns = halved(where.x, where.x + where.width, fine.cols),
                  lines = halved(where.y, where.y + where.height, fine.rows);
  if (columns.size() <= 0 || lines.size() <= 0) return {};
  const int n = columns.size();
  rows_.resize(std::max(rows_.size(), static_cast<std::size_t>(5 * n)));
  const auto smoothed = [&](int y) { return rows_.data() + y % 5 * n; };
  int next = std::max(0, 2 * lines.start - 2);  // first row that is not smoothed yet
  for (int y = lines.start; y < lines.end; ++y) {
    for (; next <= std::min(2 * y + 2, fine.rows - 1); ++next)
      smoothRow(fine.ptr(next), fine.cols, columns.start, n, smoothed(next));
    std::array<const std::uint16_t*, 5> rows{};
    for (int k = 0; k < 5; ++k)
      rows[static_cast<std::size_t>(k)] = smoothed(mirrored(2 * y + k - 2, fine.rows));
    smoothColumns(rows, n, coarse.ptr(y) + columns.start);
  }
  return {columns.start, lines.start, n, lines.size()};
}

}  // namespace omnifleet::flow
