#include "flow/pyramid.h"

#include <algorithm>
#include <array>
#include <opencv2/imgproc.hpp>

#include "geometry/wide.h"

namespace omnifleet::flow {

namespace {

constexpr int kChunk = 32;
constexpr int kMargin = 1;  // entries beside a row's even and odd pixels, for those beyond the border

/// The border's pixels come again behind it, without the outermost (BORDER_REFLECT_101).
int mirrored(int i, int size) {
  return i < 0 ? -i : i >= size ? 2 * size - 2 - i : i;
}

/// Pixels 2 (first + x) to `even`, those behind them to `odd`, x from −1 to n.
OMNIFLEET_WIDE void splitRow(const std::uint8_t* in, int width, int first, int n, std::uint8_t* even,
                             std::uint8_t* odd) {
  const std::uint8_t* from = in + 2 * first;
  const int pairs = std::min(n, width / 2 - first);
  inChunks<kChunk>(
      0, pairs, [=](int x) __attribute__((always_inline)) {
        even[x] = from[2 * x];
        odd[x] = from[2 * x + 1];
      });
  const auto at = [in, width](int x) { return in[mirrored(x, width)]; };
  if (pairs < n) {
    even[pairs] = at(2 * (first + pairs));
    odd[pairs] = at(2 * (first + pairs) + 1);
  }
  even[-1] = at(2 * first - 2);
  odd[-1] = at(2 * first - 1);
  even[n] = at(2 * (first + n));
}

/// 1 4 6 4 1 along the row, at every other pixel.
OMNIFLEET_WIDE void smoothRow(const std::uint8_t* even, const std::uint8_t* odd, int n, std::uint16_t* out) {
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        out[x] =
            static_cast<std::uint16_t>(even[x - 1] + even[x + 1] + 4 * (odd[x - 1] + odd[x]) + 6 * even[x]);
      });
}

/// The same over five such rows; the sum of all weights is 256.
OMNIFLEET_WIDE void smoothColumns(const std::array<const std::uint16_t*, 5>& rows, int n, std::uint8_t* out) {
  const std::uint16_t *a = rows[0], *b = rows[1], *c = rows[2], *d = rows[3], *e = rows[4];
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        const auto sum = static_cast<std::uint16_t>(a[x] + e[x] + 4 * (b[x] + d[x]) + 6 * c[x] + 128);
        out[x] = static_cast<std::uint8_t>(sum >> 8);
      });
}

/// Brightness of n colours, BGR: BT.601, as cv::cvtColor weighs.
OMNIFLEET_WIDE void takeGreys(const float* colours, int n, std::uint8_t* greys) {
  inChunks<kChunk>(
      0, n, [=](int x) __attribute__((always_inline)) {
        const float* c = colours + 3 * x;
        greys[x] = static_cast<std::uint8_t>(0.114f * c[0] + 0.587f * c[1] + 0.299f * c[2] + 0.5f);
      });
}

/// The pixels of the coarse row (or column) all of whose five pixels lie in [begin, end) or beyond the
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

/// Beyond the cells known the outermost come again: an edge there would stand still, whatever moves.
/// @param around of the finest level. @return of the cells' level what is new
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

/// The first of the levels.
void Pyramid::build(const cv::Mat& image, const std::vector<cv::Rect>& where, std::size_t levels) {
  for (cv::Rect rect : where) {
    if (rect.empty()) continue;
    cv::Mat1b base = levels_[0](rect);
    if (image.channels() == 3)
      cv::cvtColor(image(rect), base, cv::COLOR_BGR2GRAY);
    else
      image(rect).copyTo(base);
    for (std::size_t k = 1; k < levels && !rect.empty(); ++k) rect = halve(levels_[k - 1], rect, levels_[k]);
  }
}

void Pyramid::create(cv::Size size) {
  for (cv::Mat1b& level : levels_) {
    if (level.size() != size) level = cv::Mat1b::zeros(size);
    size = {(size.width + 1) / 2, (size.height + 1) / 2};
  }
}

/// @param where of the fine level. @return of the coarse one what is new
cv::Rect Pyramid::halve(const cv::Mat1b& fine, const cv::Rect& where, cv::Mat1b& coarse) {
  if (fine.cols < 4 || fine.rows < 4) {
    cv::pyrDown(fine, coarse);
    return {0, 0, coarse.cols, coarse.rows};
  }
  const cv::Range columns = halved(where.x, where.x + where.width, fine.cols),
                  lines = halved(where.y, where.y + where.height, fine.rows);
  if (columns.size() <= 0 || lines.size() <= 0) return {};
  const int n = columns.size();
  even_.resize(std::max(even_.size(), static_cast<std::size_t>(n + 2 * kMargin)));
  odd_.resize(even_.size());
  rows_.resize(std::max(rows_.size(), static_cast<std::size_t>(5 * n)));
  const auto smoothed = [&](int y) { return rows_.data() + y % 5 * n; };
  int next = std::max(0, 2 * lines.start - 2);  // first row that is not smoothed yet
  for (int y = lines.start; y < lines.end; ++y) {
    for (; next <= std::min(2 * y + 2, fine.rows - 1); ++next) {
      splitRow(fine.ptr(next), fine.cols, columns.start, n, even_.data() + kMargin, odd_.data() + kMargin);
      smoothRow(even_.data() + kMargin, odd_.data() + kMargin, n, smoothed(next));
    }
    std::array<const std::uint16_t*, 5> rows{};
    for (int k = 0; k < 5; ++k)
      rows[static_cast<std::size_t>(k)] = smoothed(mirrored(2 * y + k - 2, fine.rows));
    smoothColumns(rows, n, coarse.ptr(y) + columns.start);
  }
  return {columns.start, lines.start, n, lines.size()};
}

}  // namespace omnifleet::flow
