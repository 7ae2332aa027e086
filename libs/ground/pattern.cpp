#include "ground/pattern.h"

#include <algorithm>

namespace omnifleet::ground {

namespace {

constexpr float kStep = 0.1f;           // of the floor's brightness
constexpr std::uint8_t kFilled = 0x80;  // a mark of its own, or what is filled would fill on

int brightnessOf(const cv::Vec3b& colour) {
  return colour[0] + colour[1] + colour[2];
}

}  // namespace

void Pattern::Line::add(int value, int step) {
  ++length;
  low = std::min(low, value);
  high = std::max(high, value);
  if (direction >= 0 && value < high - step) {
    turns += direction;
    direction = -1;
    low = value;
  } else if (direction <= 0 && value > low + step) {
    turns -= direction;
    direction = 1;
    high = value;
  }
}

float Pattern::turns(const Blob& region, const FloorFrame& frame) {
  const cv::Rect& r = region.rect;
  const cv::Vec3f floor = floorAt(frame, r.x + r.width / 2, r.y + r.height / 2);
  const auto step = static_cast<int>(std::max(kStep * (floor[0] + floor[1] + floor[2]), 3.0f * frame.noise));
  Mean along_rows, along_columns;
  std::fill(columns_.begin() + r.x, columns_.begin() + r.x + r.width, Line{});
  for (const Run& run : region.runs) {
    const auto* pixel = frame.image.ptr<cv::Vec3b>(run.row);
    Line row;
    row.begin(brightnessOf(pixel[run.begin]));
    for (int x = run.begin; x < run.end; ++x) {
      const int value = brightnessOf(pixel[x]);
      row.add(value, step);
      Line& column = columns_[static_cast<std::size_t>(x)];
      if (column.last != run.row - 1) {
        along_columns.add(column);
        column.begin(value);
      }
      column.add(value, step);
      column.last = run.row;
    }
    along_rows.add(row);
  }
  for (int x = r.x; x < r.x + r.width; ++x) along_columns.add(columns_[static_cast<std::size_t>(x)]);
  return std::min(along_rows.value(), along_columns.value());
}

void Pattern::fillBetween(const Blob& region, std::uint8_t core, std::uint8_t shade, cv::Mat1b& marks) {
  const cv::Rect& r = region.rect;
  /// Along the line of n marks from `mark` on.
  const auto fill = [&](std::uint8_t* mark, std::size_t step, int n) {
    for (int k = 0, last = -reach_px_; k < n; ++k) {
      if ((mark[static_cast<std::size_t>(k) * step] & core) == 0) continue;
      for (int i = last + 1; i < k && k - last <= reach_px_; ++i) {
        std::uint8_t& between = mark[static_cast<std::size_t>(i) * step];
        if (between == shade) between = kFilled;
      }
      last = k;
    }
  };
  for (int y = 0; y < r.height; ++y) fill(marks.ptr(r.y + y) + r.x, 1, r.width);
  for (int x = 0; x < r.width; ++x) fill(marks.ptr(r.y) + r.x + x, marks.step, r.height);
  for (const Run& run : region.runs)
    for (int x = run.begin; x < run.end; ++x)
      if (marks(run.row, x) == kFilled) marks(run.row, x) = core | shade;
}

}  // namespace omnifleet::ground
