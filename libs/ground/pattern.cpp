#include "ground/pattern.h"

#include <cstring>

#include "geometry/lanes.h"

namespace omnifleet::ground {

namespace {

constexpr float kStep = 0.1f;  // share of the floor's brightness
constexpr float kNoise =
    3.0f;  // multiple of the tolerated noise of one channel, for the sum of three channels
constexpr std::uint8_t kAlongRow = 1, kAlongColumn = 2;
constexpr int kChunk = 16;  // pixels that are processed together
// Event of a pixel for the line along its column. Where a line begins: kBegins + the end of the previous
// line.
constexpr std::int16_t kContinues = 0, kSteps = 1, kBegins = 3;
constexpr std::int16_t kNone = -1, kRequested = -1;
constexpr std::int16_t kPatchesInARow = 3;  // patches of valid width, between four edges

OMNIFLEET_WIDE void sumChannels(const std::uint8_t* pixels, int n, std::int16_t* sums) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i)
    sums[i] = static_cast<std::int16_t>(pixels[3 * i] + pixels[3 * i + 1] + pixels[3 * i + 2]);
}

/// Updates least and most with the kChunk values that begin at `value`.
OMNIFLEET_WIDE void rangeOfChunk(const std::int16_t* value, std::int16_t& least, std::int16_t& most) {
  std::int16_t low = least, high = most;
  for (int i = 0; i < kChunk; ++i) {
    low = std::min(low, value[i]);
    high = std::max(high, value[i]);
  }
  least = low;
  most = high;
}

/// Adds the pixels [begin, end) of a row to the lines along their columns, kChunk at a time. The chunks are
/// the same for all rows, so that values are loaded as they were stored for the previous row.
/// @param value of the pixels, from the beginning of the chunk that contains `begin` @param events of
/// the pixels, from the same chunk on, output
struct NextRow {
  const std::int16_t* value;
  std::int16_t row, begin, end, step;
  const std::int16_t* requested;
  std::int16_t *low_of, *high_of, *direction_of, *end_of, *events;
};
OMNIFLEET_WIDE void addRow(const NextRow& next) {
  using Shorts = lanes::SixteenShorts;
  const Shorts order = {0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 13, 14, 15};
  const int first = next.begin & -kChunk;
  for (int x = first; x < next.end; x += kChunk) {
    const Shorts column = order + static_cast<std::int16_t>(x);
    const Shorts requested =
        lanes::load<Shorts>(next.requested + x) & (column >= next.begin) & (column < next.end);
    const auto v = lanes::load<Shorts>(next.value + (x - first)), low = lanes::load<Shorts>(next.low_of + x),
               high = lanes::load<Shorts>(next.high_of + x),
               last_direction = lanes::load<Shorts>(next.direction_of + x),
               end = lanes::load<Shorts>(next.end_of + x);
    const Shorts begins = end != next.row;
    const Shorts least = begins | (v < low) ? v : low, most = begins | (v > high) ? v : high,
                 before = ~begins & last_direction;
    const Shorts falls = (before >= 0) & (v < most - next.step),
                 rises = (before <= 0) & (v > least + next.step);
    const Shorts steps = falls | rises;
    const Shorts after = falls ? Shorts{} - 1 : rises ? Shorts{} + 1 : before;
    lanes::store(requested ? (steps ? v : least) : low, next.low_of + x);
    lanes::store(requested ? (steps ? v : most) : high, next.high_of + x);
    lanes::store(requested ? after : last_direction, next.direction_of + x);
    lanes::store(requested ? Shorts{} + static_cast<std::int16_t>(next.row + 1) : end, next.end_of + x);
    lanes::store(requested & (begins ? end + kBegins : steps & kSteps), next.events + (x - first));
  }
}

/// Marks the columns that show patches: kPatchesInARow between edges of one line.
/// @param events from addRow for the row's lines
struct Widths {
  std::int16_t row, begin, end, least_px, most_px;
  const std::int16_t* events;
  std::int16_t *last_step_of, *in_a_row_of, *patched;
};
OMNIFLEET_WIDE void findPatched(const Widths& next) {
  using Shorts = lanes::SixteenShorts;
  const int first = next.begin & -kChunk;
  for (int x = first; x < next.end; x += kChunk) {
    const auto events = lanes::load<Shorts>(next.events + (x - first)),
               last = lanes::load<Shorts>(next.last_step_of + x),
               before = lanes::load<Shorts>(next.in_a_row_of + x);
    const Shorts steps = events == kSteps, begins = events > kSteps, width = next.row - last;
    const Shorts is_patch = (last != kNone) & (width >= next.least_px) & (width <= next.most_px);
    const Shorts in_a_row = ~begins & (steps ? is_patch & (before + 1) : before);
    lanes::store(begins ? Shorts{} + kNone : steps ? Shorts{} + next.row : last, next.last_step_of + x);
    lanes::store(in_a_row, next.in_a_row_of + x);
    lanes::store(lanes::load<Shorts>(next.patched + x) | (in_a_row >= kPatchesInARow), next.patched + x);
  }
}

/// Requests the columns in which a pixel of the row has this value.
OMNIFLEET_WIDE void request(std::uint8_t value, const std::uint8_t* row, int begin, int end,
                            std::int16_t* requested) {
  inChunks<kChunk>(
      begin, end, [=](int x) __attribute__((always_inline)) {
        requested[x] = row[x] == value ? kRequested : requested[x];
      });
}

OMNIFLEET_WIDE void markPatched(const std::int16_t* patched_end, int row, int n, std::uint8_t* along) {
#pragma GCC ivdep
  for (int i = 0; i < n; ++i) along[i] |= row < patched_end[i] ? kAlongColumn : std::uint8_t{0};
}

}  // namespace

Pattern::Columns::Columns(int width)
    : requested(static_cast<std::size_t>(width + kChunk)),
      low(requested),
      high(low),
      direction(low),
      end(low),
      patched_end(low),
      last_step(low),
      in_a_row(low),
      patched(low),
      steps(static_cast<std::size_t>(width)) {}

Pattern::Pattern(cv::Size image)
    : lines_(image, std::uint8_t{0}),
      columns_(image.width),
      brightness_(static_cast<std::size_t>(image.width + 2 * kChunk)),
      events_(brightness_),
      least_px_(image.width / kLeastShare),
      most_px_(image.width / kMostShare) {}

void Pattern::Steps::add(int at_px) {
  ++taken;
  last = {last[1], last[2], last[3], at_px};
}

cv::Range Pattern::Steps::patches(int least_px, int most_px) const {
  if (last.front() == kNoStep) return {0, 0};
  for (std::size_t i = 1; i < last.size(); ++i) {
    const int width = last[i] - last[i - 1];
    if (width < least_px || width > most_px) return {0, 0};
  }
  const int beside = (last.back() - last.front()) / static_cast<int>(last.size() - 1);
  return {std::max(begin, last.front() - beside), last.back() + beside};
}

/// Minimum change of an edge, in the sum of three channels.
int Pattern::stepOf(const Blob& region, const FloorFrame& frame) const {
  const cv::Rect& r = region.rect;
  const cv::Vec3f floor = floorAt(frame, r.x + r.width / 2, r.y + r.height / 2);
  return static_cast<int>(std::max(kStep * (floor[0] + floor[1] + floor[2]), kNoise * frame.noise));
}

/// From the beginning of the chunk that contains the run's first pixel.
const std::int16_t* Pattern::brightnessOf(const FloorFrame& frame, const Run& run) {
  sumChannels(frame.image.ptr(run.row) + 3 * run.begin, run.end - run.begin,
              brightness_.data() + run.begin % kChunk);
  return brightness_.data();
}

void Pattern::find(const Blob& region, const FloorFrame& frame) {
  const int step = stepOf(region, frame);
  Mean rows;
  for (const Run& run : region.runs) rows.add(findAlongRow(run, frame, step), run.end);
  const cv::Range columns(region.rect.x, region.rect.br().x);
  std::fill_n(columns_.requested.begin() + columns.start, columns.size(), kRequested);
  turns_ = std::min(rows.value(), findAlongColumns(region, frame, step, columns).value());
}

Pattern::Steps Pattern::findAlongRow(const Run& run, const FloorFrame& frame, int step) {
  std::uint8_t* along = lines_.ptr(run.row);
  const std::int16_t* value = brightnessOf(frame, run) + run.begin % kChunk;
  Steps steps{run.begin};
  int direction = 0, patched_end = run.begin;
  std::int16_t low = value[0], high = value[0];
  const int n = run.end - run.begin;
  for (int i = 0; i < n; ++i) {
    if (i % kChunk == 0) {
      // A chunk without an edge is processed at once.
      for (; i + kChunk <= n; i += kChunk) {
        std::int16_t least = low, most = high;
        rangeOfChunk(value + i, least, most);
        if ((direction >= 0 && least < most - step) || (direction <= 0 && most > least + step)) break;
        low = least;
        high = most;
      }
      if (i == n) break;
    }
    low = std::min(low, value[i]);
    high = std::max(high, value[i]);
    const bool falls = direction >= 0 && value[i] < high - step,
               rises = direction <= 0 && value[i] > low + step;
    if (!falls && !rises) continue;
    direction = falls ? -1 : 1;
    low = high = value[i];
    steps.add(run.begin + i);
    const cv::Range patches = steps.patches(least_px_, most_px_);
    for (int x = std::max(patched_end, patches.start); x < std::min(patches.end, run.end); ++x)
      along[x] |= kAlongRow;
    patched_end = std::max(patched_end, patches.end);
  }
  return steps;
}

/// Calls visit(part) for the part of each run in these columns, from top to bottom, once events_ holds the
/// events of its pixels.
template <typename Visit>
void Pattern::forRows(const Blob& region, const FloorFrame& frame, int step, const cv::Range& columns,
                      Visit visit) {
  std::fill_n(columns_.end.begin() + columns.start, columns.size(), kNone);
  for (const Run& run : region.runs) {
    const Run part{run.row, std::max(run.begin, columns.start), std::min(run.end, columns.end)};
    if (part.begin >= part.end) continue;
    addRow({brightnessOf(frame, part), static_cast<std::int16_t>(part.row),
            static_cast<std::int16_t>(part.begin), static_cast<std::int16_t>(part.end),
            static_cast<std::int16_t>(step), columns_.requested.data(), columns_.low.data(),
            columns_.high.data(), columns_.direction.data(), columns_.end.data(), events_.data()});
    visit(part);
  }
}

Pattern::Mean Pattern::findAlongColumns(const Blob& region, const FloorFrame& frame, int step,
                                        const cv::Range& requested) {
  std::fill_n(columns_.steps.begin() + requested.start, requested.size(), Steps{kNone});
  std::fill_n(columns_.patched_end.begin() + requested.start, requested.size(), std::int16_t{0});
  Mean mean;
  forRows(region, frame, step, requested, [&](const Run& part) {
    takeEvents(part, mean);
    markPatched(&columns_.patched_end[static_cast<std::size_t>(part.begin)], part.row, part.end - part.begin,
                lines_.ptr(part.row) + part.begin);
  });
  for (int x = requested.start; x < requested.end; ++x) {
    const auto column = static_cast<std::size_t>(x);
    mean.add(columns_.steps[column], columns_.end[column]);
  }
  return mean;
}

void Pattern::takeEvents(const Run& run, Mean& mean) {
  constexpr int kAtOnce = 4;
  const int first = run.begin & -kChunk;
  for (int x = run.begin & -kAtOnce; x < run.end; ++x) {
    const std::int16_t* at = events_.data() + (x - first);
    std::uint64_t some = 1;
    if (x % kAtOnce == 0) std::memcpy(&some, at, sizeof some);
    if (some == 0) {
      x += kAtOnce - 1;
      continue;
    }
    const std::int16_t event = *at;
    if (event == kContinues) continue;
    const auto column = static_cast<std::size_t>(x);
    Steps& steps = columns_.steps[column];
    std::int16_t& patched_end = columns_.patched_end[column];
    if (event != kSteps) {
      mean.add(steps, event - kBegins);
      steps = {run.row};
      patched_end = static_cast<std::int16_t>(run.row);
      continue;
    }
    steps.add(run.row);
    const cv::Range patches = steps.patches(least_px_, most_px_);
    for (int y = std::max<int>(patched_end, patches.start); y < std::min(patches.end, run.row); ++y)
      lines_(y, x) |= kAlongColumn;
    patched_end = static_cast<std::int16_t>(std::max<int>(patched_end, patches.end));
  }
}

/// Keeps only those of the requested columns that have patches of such widths. @return the range that
/// contains them
cv::Range Pattern::requestPatched(const Blob& region, const FloorFrame& frame, int step) {
  const cv::Range all(region.rect.x, region.rect.br().x);
  for (std::vector<std::int16_t>* of : {&columns_.last_step, &columns_.in_a_row, &columns_.patched})
    std::fill_n(of->begin() + all.start, all.size(), of == &columns_.last_step ? kNone : std::int16_t{0});
  forRows(region, frame, step, requestedIn(all), [&](const Run& part) {
    findPatched({static_cast<std::int16_t>(part.row), static_cast<std::int16_t>(part.begin),
                 static_cast<std::int16_t>(part.end), static_cast<std::int16_t>(least_px_),
                 static_cast<std::int16_t>(most_px_), events_.data(), columns_.last_step.data(),
                 columns_.in_a_row.data(), columns_.patched.data()});
  });
  std::copy_n(columns_.patched.begin() + all.start, all.size(), columns_.requested.begin() + all.start);
  return requestedIn(all);
}

/// From the first to the last requested column.
cv::Range Pattern::requestedIn(const cv::Range& columns) const {
  const auto at = [&](int x) { return columns_.requested.begin() + x; };
  const auto isRequested = [](std::int16_t requested) { return requested != 0; };
  const auto first = std::find_if(at(columns.start), at(columns.end), isRequested);
  auto end = at(columns.end);
  while (end != first && !isRequested(end[-1])) --end;
  return {static_cast<int>(first - at(0)), static_cast<int>(end - at(0))};
}

/// Processes only marked pixels. First the columns that contain any are checked, which is eight times as fast
/// as rows. Columns that may show a pattern are then processed in detail, and finally the rows that one of
/// these columns suggests.
void Pattern::fill(const Blob& region, const FloorFrame& frame, std::uint8_t core, std::uint8_t shadow,
                   cv::Mat1b& marks) {
  std::fill_n(columns_.requested.begin() + region.rect.x, region.rect.width, std::int16_t{0});
  for (const Run& run : region.runs)
    request(shadow, marks.ptr(run.row), run.begin, run.end, columns_.requested.data());
  const int step = stepOf(region, frame);
  const cv::Range columns = requestPatched(region, frame, step);
  if (columns.empty()) return;
  for (const Run& run : region.runs)
    std::fill(lines_.ptr(run.row) + run.begin, lines_.ptr(run.row) + run.end, std::uint8_t{0});
  findAlongColumns(region, frame, step, columns);
  for (const Run& run : region.runs) {
    std::uint8_t* mark = marks.ptr(run.row);
    const std::uint8_t* along = lines_.ptr(run.row);
    const int end = std::min(run.end, columns.end);
    int x = std::max(run.begin, columns.start);
    while (x < end && (mark[x] != shadow || (along[x] & kAlongColumn) == 0)) ++x;
    if (x >= end) continue;
    findAlongRow(run, frame, step);
    for (; x < end; ++x)
      if (mark[x] == shadow && along[x] == (kAlongRow | kAlongColumn)) mark[x] = core | shadow;
  }
}

}  // namespace omnifleet::ground
