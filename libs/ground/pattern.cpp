#include "ground/pattern.h"

#include <algorithm>
#include <cstring>

namespace omnifleet::ground {

namespace {

constexpr float kStep = 0.1f;   // of the floor's brightness
constexpr float kNoise = 3.0f;  // of what is tolerated in one pixel's channel: of the sum of three
constexpr std::uint8_t kAlongRow = 1, kAlongColumn = 2;

int brightnessOf(const cv::Vec3b& colour) {
  return colour[0] + colour[1] + colour[2];
}

/// Of a region's pixels with a mark.
cv::Rect boundsOf(const Blob& region, std::uint8_t mark, const cv::Mat1b& marks) {
  int left = marks.cols, right = 0, top = marks.rows, bottom = 0;
  for (const Run& run : region.runs) {
    const std::uint8_t *begin = marks.ptr(run.row) + run.begin, *end = marks.ptr(run.row) + run.end;
    const auto* first =
        static_cast<const std::uint8_t*>(std::memchr(begin, mark, static_cast<std::size_t>(end - begin)));
    if (first == nullptr) continue;
    while (*(end - 1) != mark) --end;
    left = std::min(left, static_cast<int>(first - marks.ptr(run.row)));
    right = std::max(right, static_cast<int>(end - marks.ptr(run.row)));
    top = std::min(top, run.row);
    bottom = std::max(bottom, run.row + 1);
  }
  return left < right ? cv::Rect(left, top, right - left, bottom - top) : cv::Rect();
}

}  // namespace

bool Pattern::Line::add(int at_px, int value, int step) {
  end = at_px + 1;
  low = std::min(low, value);
  high = std::max(high, value);
  const bool falls = direction >= 0 && value < high - step, rises = direction <= 0 && value > low + step;
  if (!falls && !rises) return false;
  turns += direction != 0 ? 1 : 0;
  direction = falls ? -1 : 1;
  low = high = value;
  steps = {steps[1], steps[2], steps[3], at_px};
  return true;
}

cv::Range Pattern::Line::patches(int least_px, int most_px) const {
  if (steps.front() == kNoStep) return {0, 0};
  for (std::size_t i = 1; i < steps.size(); ++i) {
    const int width = steps[i] - steps[i - 1];
    if (width < least_px || width > most_px) return {0, 0};
  }
  const int beside = (steps.back() - steps.front()) / static_cast<int>(steps.size() - 1);
  return {std::max(begin, steps.front() - beside), steps.back() + beside};
}

void Pattern::find(const Blob& region, const FloorFrame& frame) {
  find(region, frame, region.rect);
}

void Pattern::find(const Blob& region, const FloorFrame& frame, const cv::Rect& asked) {
  const cv::Rect& r = region.rect;
  const cv::Vec3f floor = floorAt(frame, r.x + r.width / 2, r.y + r.height / 2);
  const auto step =
      static_cast<int>(std::max(kStep * (floor[0] + floor[1] + floor[2]), kNoise * frame.noise));
  const int first = std::max(r.x, asked.x), last = std::min(r.br().x, asked.br().x);
  Mean rows, columns;
  std::fill(columns_.begin() + r.x, columns_.begin() + r.x + r.width, Line{});
  for (const Run& run : region.runs) {
    const auto* pixel = frame.image.ptr<cv::Vec3b>(run.row);
    std::uint8_t* along = lines_.ptr(run.row);
    std::fill(along + run.begin, along + run.end, std::uint8_t{0});
    if (run.row >= asked.y && run.row < asked.br().y) rows.add(findAlongRow(run, pixel, step));
    for (int x = std::max(run.begin, first); x < std::min(run.end, last); ++x) {
      const int value = brightnessOf(pixel[x]);
      Line& column = columns_[static_cast<std::size_t>(x)];
      if (column.end != run.row) {
        columns.add(column);
        column.start(run.row, value);
      }
      if (column.add(run.row, value, step)) {
        const cv::Range patches = column.patches(least_px_, most_px_);
        for (int i = std::max(column.patched_end, patches.start); i < std::min(patches.end, run.row); ++i)
          lines_(i, x) |= kAlongColumn;
        column.patched_end = std::max(column.patched_end, patches.end);
      }
      if (run.row < column.patched_end) along[x] |= kAlongColumn;
    }
  }
  for (int x = r.x; x < r.x + r.width; ++x) columns.add(columns_[static_cast<std::size_t>(x)]);
  turns_ = std::min(rows.value(), columns.value());
}

Pattern::Line Pattern::findAlongRow(const Run& run, const cv::Vec3b* pixel, int step) {
  std::uint8_t* along = lines_.ptr(run.row);
  Line row;
  row.start(run.begin, brightnessOf(pixel[run.begin]));
  for (int x = run.begin; x < run.end; ++x) {
    if (!row.add(x, brightnessOf(pixel[x]), step)) continue;
    const cv::Range patches = row.patches(least_px_, most_px_);
    for (int i = std::max(row.patched_end, patches.start); i < std::min(patches.end, run.end); ++i)
      along[i] |= kAlongRow;
    row.patched_end = std::max(row.patched_end, patches.end);
  }
  return row;
}

void Pattern::fill(const Blob& region, const FloorFrame& frame, std::uint8_t core, std::uint8_t shade,
                   cv::Mat1b& marks) {
  const cv::Rect asked = boundsOf(region, shade, marks);
  if (asked.empty()) return;
  find(region, frame, asked);
  for (const Run& run : region.runs) {
    const std::uint8_t* along = lines_.ptr(run.row);
    std::uint8_t* mark = marks.ptr(run.row);
    for (int x = run.begin; x < run.end; ++x)
      if (mark[x] == shade && along[x] == (kAlongRow | kAlongColumn)) mark[x] = core | shade;
  }
}

}  // namespace omnifleet::ground
