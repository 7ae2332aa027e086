#include "ground/thing_completer.h"

#include <algorithm>

#include "ground/floor_view.h"

namespace omnifleet::ground {

namespace {

constexpr int kMemory = 50;  // frames that a thing whose top alone is plain to see is remembered for
constexpr std::size_t kFewestBands = 3;  // of a thing

/// Plainly no floor, yet not of what was found: it is as thin as a marking of the floor.
bool isLost(const Blob& region, const SideCompleter::Frame& frame) {
  const Run& run = region.runs[region.runs.size() / 2];
  const int x = (run.begin + run.end) / 2;
  const Look look = frame.looks(run.row, x);
  return (look == kColourLook || (isGrey(look) && gainOf(look) < kDeepestShade)) &&
         !frame.found.at(x, run.row);
}

}  // namespace

ThingCompleter::ThingCompleter(const lens::Camera& camera, cv::Size image)
    : sides_(camera, image), tops_(camera, image), bands_(image) {}

bool ThingCompleter::complete(const SideCompleter::Frame& frame, const Raw& raw, ShadeFilter& shade,
                              const Found& found) {
  completeTops(frame.shade, shade, found);
  bool any = !settled_.empty();
  for (const Blob* side : shade.sides()) {
    const std::vector<Run>& whole = sides_.complete(frame, *side);
    if (whole.empty()) continue;
    replace(*side, whole, found);
    any = true;
  }
  completeBands(frame, raw, shade);
  set(between_, found);
  return any || !between_.empty();
}

/// Asked are things that are not compact, and bands by themselves where there are enough for a thing.
void ThingCompleter::completeBands(const SideCompleter::Frame& frame, const Raw& raw,
                                   const ShadeFilter& shade) {
  between_.clear();
  banded_.clear();
  if (raw.regions != nullptr) {
    for (const Blob& region : *raw.regions)
      if (bands_.isBand(region) && isLost(region, frame)) banded_.push_back(&region);
  }
  for (const Blob* thing : shade.things())
    if (bands_.isBand(*thing)) banded_.push_back(thing);
  if (banded_.size() < kFewestBands) banded_.clear();
  for (const Blob* thing : shade.things())
    if (!bands_.isBand(*thing) && BandCompleter::isRagged(*thing, frame.found)) banded_.push_back(thing);
  cv::Rect done;
  for (const Blob* region : banded_) {
    if ((region->rect & done) == region->rect) continue;  // a band of the last one
    const std::vector<Run>& between = bands_.find(*region, {raw.mask, raw.cleaned, frame.looks});
    between_.insert(between_.end(), between.begin(), between.end());
    for (const Run& run : between) done |= cv::Rect(run.begin, run.row, run.end - run.begin, 1);
  }
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
  for (const Run& run : part.runs) found.bits.clear(run.row, run.begin, run.end);
  set(whole, found);
}

void ThingCompleter::set(const std::vector<Run>& runs, const Found& found) {
  constexpr int kCell = FloorView::kCell;
  for (const Run& run : runs) {
    found.bits.set(run.row, run.begin, run.end);
    for (int x = run.begin / kCell; x * kCell < run.end; ++x) found.cells(run.row / kCell, x) = 1;
  }
}

}  // namespace omnifleet::ground
