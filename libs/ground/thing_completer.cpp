#include "ground/thing_completer.h"

#include <algorithm>

#include "ground/floor_view.h"

namespace omnifleet::ground {

namespace {

constexpr int kMemory = 50;  // frames that a thing whose top alone is plain to see is remembered for

}  // namespace

ThingCompleter::ThingCompleter(const lens::Camera& camera, cv::Size image)
    : sides_(camera, image), tops_(camera, image) {}

bool ThingCompleter::complete(const SideCompleter::Frame& frame, ShadeFilter& shade, const Found& found) {
  completeTops(frame.shade, shade, found);
  bool any = !settled_.empty();
  for (const Blob* side : shade.sides()) {
    const std::vector<Run>& whole = sides_.complete(frame, *side);
    if (whole.empty()) continue;
    replace(*side, whole, found);
    any = true;
  }
  return any;
}

void ThingCompleter::completeTops(const ShadeFilter::Frame& frame, ShadeFilter& shade, const Found& found) {
  settled_.clear();
  alone_.clear();
  bool any_top = false;
  for (const Blob* top : shade.lights()) {
    const std::vector<Run>& whole = tops_.complete(frame, *top);
    any_top = any_top || !whole.empty() || tops_.isDoubtful();
    if (whole.empty() && tops_.isAlone()) alone_.push_back(top);
    if (whole.empty()) continue;
    replace(*top, whole, found);
    settled_.push_back(top);
    const Run& middle = whole[whole.size() / 2];
    rough_.emplace_back((middle.begin + middle.end) / 2, middle.row);
  }
  remembered_ = any_top ? kMemory + 1 : std::max(0, remembered_ - 1);
  if (remembered_ == 0) return;
  // Where there are things whose tops alone are plain to see, what is not known to be whole is one's top;
  // where there were some of late, what shows nothing but a top.
  const std::vector<const Blob*>& asked = any_top ? shade.lights() : alone_;
  const std::size_t known = settled_.size();
  for (const Blob* top : asked) {
    const auto end = settled_.begin() + static_cast<std::ptrdiff_t>(known);
    if (std::find(settled_.begin(), end, top) != end) continue;
    for (const Run& run : top->runs) found.bits.clear(run.row, run.begin, run.end);
    shade.doubt(*top);
    settled_.push_back(top);
  }
  shade.decide(found.bits);
}

bool ThingCompleter::isRough(const Blob& region) const {
  return std::any_of(rough_.begin(), rough_.end(), [&](const cv::Point& at) {
    return region.rect.contains(at) &&
           std::any_of(region.runs.begin(), region.runs.end(), [&](const Run& run) {
             return run.row == at.y && run.begin <= at.x && at.x < run.end;
           });
  });
}

void ThingCompleter::replace(const Blob& part, const std::vector<Run>& whole, const Found& found) {
  constexpr int kCell = FloorView::kCell;
  for (const Run& run : part.runs) found.bits.clear(run.row, run.begin, run.end);
  for (const Run& run : whole) {
    found.bits.set(run.row, run.begin, run.end);
    for (int x = run.begin / kCell; x * kCell < run.end; ++x) found.cells(run.row / kCell, x) = 1;
  }
}

}  // namespace omnifleet::ground
