#include "ground/hue_window.h"

#include <algorithm>

namespace omnifleet::ground {

namespace {

constexpr int kAround = HueWindow::kAround_px;

/// A row of the frame with its marks.
struct Row {
  const std::uint8_t *pixels, *marks;
  HueWindow::Sum at(int x) const {
    if ((marks[x] & HueWindow::kCounts) == 0) return 0;
    const std::uint8_t* p = pixels + 3 * x;
    return std::uint64_t{p[0]} | std::uint64_t{p[1]} << 16 | std::uint64_t{p[2]} << 32 |
           std::uint64_t{1} << 48;
  }
};

}  // namespace

HueWindow::HueWindow(int image_width) : columns_(static_cast<std::size_t>(image_width + 2 * kAround)) {}

void HueWindow::begin() {
  // Advances the row count so far that no older column counts as that of the previous row.
  constexpr std::int64_t kMoreThanAnyImage = 1 << 20;
  first_row_ += kMoreThanAnyImage;
}

void HueWindow::addColumns(const Run& run, const cv::Mat& image, const cv::Mat1b& marks) {
  const auto rowAt = [&](int y) { return Row{image.ptr(y), marks.ptr(y)}; };
  const int top = std::max(0, run.row - kAround), bottom = std::min(image.rows - 1, run.row + kAround);
  // Rows that enter and leave the window when it moves down by one row.
  const Row in = rowAt(bottom), out = rowAt(std::max(0, run.row - kAround - 1));
  const bool has_incoming = run.row + kAround < image.rows, has_outgoing = run.row - kAround - 1 >= 0;
  const std::int64_t row = first_row_ + run.row;
  const int begin = std::max(0, run.begin - kAround), end = std::min(image.cols, run.end + kAround);
  for (int x = begin; x < end; ++x) {
    Column& column = columns_[static_cast<std::size_t>(x + kAround)];
    if (column.row == row) continue;
    if (column.row == row - 1) {
      if (has_incoming) column.sum += in.at(x);
      if (has_outgoing) column.sum -= out.at(x);
    } else {
      column.sum = 0;
      for (int y = top; y <= bottom; ++y) column.sum += rowAt(y).at(x);
    }
    column.row = row;
  }
}

}  // namespace omnifleet::ground
