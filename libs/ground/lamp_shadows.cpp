#include "ground/lamp_shadows.h"

#include <algorithm>

#include "ground/parting.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
// Of what is not the lamp's: how light its shadow is, beside a thing (which keeps some of that off, too) at
// least; what it is surely, by its light alone.
constexpr float kDeepest = 0.5f, kLeastSure = 0.85f, kMostSure = 1.5f;
constexpr float kStep_px = 2.0f;
constexpr int kSteps = 60;
constexpr int kInARow = 2;       // steps that meet the same: single ones are noise
constexpr int kKind_px = 16;     // pixels that make a kind
constexpr float kApart = 0.65f;  // of the brightness of the lighter kind: the darker one has no more
constexpr float kLeastOfShade = 0.6f, kMostOfShade = 1.4f;  // of what is not the lamp's: the lighter kind

const cv::Vec2f kNowhere(0.0f, 0.0f);

struct Kind {
  int pixels = 0;
  float gain = 0.0f;  ///< mean
};

}  // namespace

float LampShadows::besideAt(const cv::Point& pixel) const {
  return beside_(std::min(pixel.y / kCell, beside_.rows - 1), std::min(pixel.x / kCell, beside_.cols - 1));
}

/// The dark of a grey thing and of its shadow part where both are much; then what is darker than this is the
/// thing. kFloorLook where there are not both.
Look LampShadows::partingOfKinds(const Blob& region, const cv::Mat1b& looks) {
  const Look end = greyLook(kDeepestShade);
  pixels_.fill(0);
  for (const Run& run : region.runs) {
    const Look* row = looks.ptr(run.row);
    for (int x = run.begin; x < run.end; ++x)
      if (isGrey(row[x]) && row[x] <= end) ++pixels_[row[x]];
  }
  const Look parting = partingOf(pixels_);
  if (parting == kFloorLook) return kFloorLook;
  const auto kindOf = [&](int from, int to) {
    Kind kind;
    for (int look = from; look < to; ++look) {
      const int n = pixels_[static_cast<std::size_t>(look)];
      kind.pixels += n;
      kind.gain += static_cast<float>(n) * gainOf(static_cast<Look>(look));
    }
    kind.gain /= static_cast<float>(std::max(1, kind.pixels));
    return kind;
  };
  const Kind thing = kindOf(kColourLook + 1, parting), shade = kindOf(parting, end + 1);
  const float share = shade.gain / besideAt(middleOf(region));
  const bool are_both = std::min(thing.pixels, shade.pixels) >= kKind_px &&
                        thing.gain < kApart * shade.gain && share > kLeastOfShade && share < kMostOfShade;
  return are_both ? parting : kFloorLook;
}

void LampShadows::mark(FloorLight& light, const std::vector<Blob>& regions, cv::Mat1b& looks) {
  towards_ = light.towardsLampOfCells();
  beside_ = light.besideLampOfCells();
  const Look end = greyLook(kDeepestShade);
  shade_.clear();
  for (const Blob& region : regions) {
    const Look parting = partingOfKinds(region, looks), first = std::max<Look>(parting, kColourLook + 1);
    for (const Run& run : region.runs) {
      const Look* row = looks.ptr(run.row);
      for (int x = run.begin; x < run.end; ++x) {
        if (row[x] < first || row[x] > end) continue;
        const cv::Point at(x, run.row);
        const float share = gainOf(row[x]) / besideAt(at);
        const bool is_sure = share > kLeastSure && share < kMostSure;
        if (is_sure || (share > kDeepest && isThrown(at, parting, looks))) shade_.push_back(at);
      }
    }
  }
  for (const cv::Point& at : shade_) looks(at) = kLampShade;
}

bool LampShadows::isThrown(const cv::Point& from, Look parting, const cv::Mat1b& looks) const {
  cv::Point2f at(from);
  int on_floor = 0, on_thing = 0;
  for (int step = 0; step < kSteps; ++step) {
    const cv::Point pixel(cvRound(at.x), cvRound(at.y));
    if (pixel.x < 0 || pixel.y < 0 || pixel.x >= looks.cols || pixel.y >= looks.rows) return false;
    const int y = std::min(pixel.y / kCell, towards_.rows - 1),
              x = std::min(pixel.x / kCell, towards_.cols - 1);
    if (view_->isOwnBody(pixel)) return true;
    if (view_->mask()(pixel) == 0 || towards_(y, x) == kNowhere) return false;
    const Look look = looks(pixel);
    const bool is_thing =
        look == kColourLook || (isGrey(look) && (look < parting || gainOf(look) > 1.0f + kFaintContrast));
    on_floor = look == kFloorLook ? on_floor + 1 : 0;
    on_thing = is_thing ? on_thing + 1 : 0;
    if (on_thing >= kInARow) return true;
    if (on_floor >= kInARow) return false;
    at += kStep_px * cv::Point2f(towards_(y, x));
  }
  return false;
}

}  // namespace omnifleet::ground
