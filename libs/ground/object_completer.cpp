#include "ground/object_completer.h"

#include <algorithm>

#include "ground/floor_view.h"

namespace omnifleet::ground {

namespace {

constexpr int kMemory = 50;              // frames for which an object with only its top visible is remembered
constexpr std::size_t kFewestBands = 3;  // minimum number of bands per object

/// Is the region plainly not floor, yet missing from what was found? It is as thin as a floor marking.
bool isAsThinAsMarking(const Blob& region, const SideCompleter::Frame& frame) {
  const Run& run = region.runs[region.runs.size() / 2];
  const int x = (run.begin + run.end) / 2;
  const Appearance appearance = frame.appearances(run.row, x);
  return (appearance == kColourAppearance || (isGrey(appearance) && gainOf(appearance) < kDeepestShadow)) &&
         !frame.found.at(x, run.row);
}

}  // namespace

ObjectCompleter::ObjectCompleter(const lens::Camera& camera, cv::Size image)
    : sides_(camera, image), tops_(camera, image), bands_(image) {}

bool ObjectCompleter::complete(const SideCompleter::Frame& frame, const Raw& raw, ShadowFilter& shadow,
                               const Found& found) {
  completeTops(frame.shadow, shadow, found);
  bool any = !settled_.empty();
  for (const Blob* side : shadow.sides()) {
    const std::vector<Run>& whole = sides_.complete(frame, *side);
    if (whole.empty()) continue;
    replace(*side, whole, found);
    any = true;
  }
  completeBands(frame, raw, shadow);
  set(between_, found);
  return any || !between_.empty();
}

/// Tries objects that are not compact, and bands by themselves where there are enough of them for an object.
void ObjectCompleter::completeBands(const SideCompleter::Frame& frame, const Raw& raw,
                                    const ShadowFilter& shadow) {
  between_.clear();
  banded_.clear();
  if (raw.regions != nullptr) {
    for (const Blob& region : *raw.regions)
      if (bands_.isBand(region) && isAsThinAsMarking(region, frame)) banded_.push_back(&region);
  }
  for (const Blob* object : shadow.objects())
    if (bands_.isBand(*object)) banded_.push_back(object);
  if (banded_.size() < kFewestBands) banded_.clear();
  for (const Blob* object : shadow.objects())
    if (!bands_.isBand(*object) && BandCompleter::isRagged(*object, frame.found)) banded_.push_back(object);
  cv::Rect done;
  for (const Blob* region : banded_) {
    if ((region->rect & done) == region->rect) continue;  // a band of the previous object
    const std::vector<Run>& between = bands_.find(*region, {raw.mask, raw.cleaned, frame.appearances});
    between_.insert(between_.end(), between.begin(), between.end());
    for (const Run& run : between) done |= cv::Rect(run.begin, run.row, run.end - run.begin, 1);
  }
}

void ObjectCompleter::completeTops(const ShadowFilter::Frame& frame, ShadowFilter& shadow,
                                   const Found& found) {
  settled_.clear();
  top_only_.clear();
  bool any_top = false;
  for (const Blob* top : shadow.lights()) {
    const std::vector<Run>& whole = tops_.complete(frame, *top);
    any_top = any_top || !whole.empty() || tops_.isUndecided();
    if (whole.empty() && tops_.isTopOnly()) top_only_.push_back(top);
    if (whole.empty()) continue;
    replace(*top, whole, found);
    settled_.push_back(top);
    const Run& middle = whole[whole.size() / 2];
    rough_.emplace_back((middle.begin + middle.end) / 2, middle.row);
  }
  remembered_ = any_top ? kMemory + 1 : std::max(0, remembered_ - 1);
  if (remembered_ == 0) return;
  // If this frame shows objects of which only the top is plainly visible, every light region that is not
  // known to be whole may be such a top. If only recent frames did, this holds for regions that show nothing
  // but a top.
  const std::vector<const Blob*>& asked = any_top ? shadow.lights() : top_only_;
  const std::size_t known = settled_.size();
  for (const Blob* top : asked) {
    const auto end = settled_.begin() + static_cast<std::ptrdiff_t>(known);
    if (std::find(settled_.begin(), end, top) != end) continue;
    for (const Run& run : top->runs) found.bits.clear(run.row, run.begin, run.end);
    shadow.markUndecided(*top);
    settled_.push_back(top);
  }
  shadow.decide(found.bits);
}

bool ObjectCompleter::isRough(const Blob& region) const {
  return std::any_of(rough_.begin(), rough_.end(), [&](const cv::Point& at) {
    return region.rect.contains(at) &&
           std::any_of(region.runs.begin(), region.runs.end(), [&](const Run& run) {
             return run.row == at.y && run.begin <= at.x && at.x < run.end;
           });
  });
}

void ObjectCompleter::replace(const Blob& part, const std::vector<Run>& whole, const Found& found) {
  for (const Run& run : part.runs) found.bits.clear(run.row, run.begin, run.end);
  set(whole, found);
}

void ObjectCompleter::set(const std::vector<Run>& runs, const Found& found) {
  constexpr int kCell = FloorView::kCell;
  for (const Run& run : runs) {
    found.bits.set(run.row, run.begin, run.end);
    for (int x = run.begin / kCell; x * kCell < run.end; ++x) found.cells(run.row / kCell, x) = 1;
  }
}

}  // namespace omnifleet::ground
