#include "ground/lamp_shadows.h"

#include <algorithm>

#include "ground/otsu_threshold.h"

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
// Brightness of a shadow as a share of the light that is not the lamp's. kDeepest: the minimum beside an
// object, which blocks some of that light, too. kLeastSure to kMostSure: certainly the lamp's shadow, by its
// brightness alone.
constexpr float kDeepest = 0.5f, kLeastSure = 0.85f, kMostSure = 1.5f;
constexpr float kStep_px = 2.0f;
constexpr int kSteps = 60;
constexpr int kConsecutive = 2;     // consecutive steps that meet the same class; single ones are noise
constexpr int kMinKind_px = 16;     // minimum number of pixels of a kind
constexpr float kMaxRatio = 0.65f;  // the darker kind has at most this share of the lighter kind's brightness
constexpr float kLeastOfShadow = 0.6f,
                kMostOfShadow =
                    1.4f;  // brightness of the lighter kind, as a share of the light that is not the lamp's

const cv::Vec2f kNowhere(0.0f, 0.0f);

struct Kind {
  int pixels = 0;
  float gain = 0.0f;  ///< mean
};

}  // namespace

float LampShadows::besideAt(const cv::Point& pixel) const {
  return beside_(std::min(pixel.y / kCell, beside_.rows - 1), std::min(pixel.x / kCell, beside_.cols - 1));
}

/// Otsu threshold between a dark grey object and its shadow, where the region contains enough of both. Pixels
/// below it belong to the object. kFloorAppearance where the region does not contain both.
Appearance LampShadows::thresholdBetweenKinds(const Blob& region, const cv::Mat1b& appearances) {
  const Appearance end = greyAppearance(kDeepestShadow);
  pixels_.fill(0);
  for (const Run& run : region.runs) {
    const Appearance* row = appearances.ptr(run.row);
    for (int x = run.begin; x < run.end; ++x)
      if (isGrey(row[x]) && row[x] <= end) ++pixels_[row[x]];
  }
  const Appearance threshold = otsuThreshold(pixels_);
  if (threshold == kFloorAppearance) return kFloorAppearance;
  const auto kindOf = [&](int from, int to) {
    Kind kind;
    for (int appearance = from; appearance < to; ++appearance) {
      const int n = pixels_[static_cast<std::size_t>(appearance)];
      kind.pixels += n;
      kind.gain += static_cast<float>(n) * gainOf(static_cast<Appearance>(appearance));
    }
    kind.gain /= static_cast<float>(std::max(1, kind.pixels));
    return kind;
  };
  const Kind object = kindOf(kColourAppearance + 1, threshold), shadow = kindOf(threshold, end + 1);
  const float share = shadow.gain / besideAt(middleOf(region));
  const bool are_both = std::min(object.pixels, shadow.pixels) >= kMinKind_px &&
                        object.gain < kMaxRatio * shadow.gain && share > kLeastOfShadow &&
                        share < kMostOfShadow;
  return are_both ? threshold : kFloorAppearance;
}

void LampShadows::mark(FloorLight& light, const std::vector<Blob>& regions, cv::Mat1b& appearances) {
  towards_ = light.towardsLampOfCells();
  beside_ = light.ambientShareOfCells();
  const Appearance end = greyAppearance(kDeepestShadow);
  shadow_.clear();
  for (const Blob& region : regions) {
    const Appearance threshold = thresholdBetweenKinds(region, appearances),
                     first = std::max<Appearance>(threshold, kColourAppearance + 1);
    for (const Run& run : region.runs) {
      const Appearance* row = appearances.ptr(run.row);
      for (int x = run.begin; x < run.end; ++x) {
        if (row[x] < first || row[x] > end) continue;
        const cv::Point at(x, run.row);
        const float share = gainOf(row[x]) / besideAt(at);
        const bool is_sure = share > kLeastSure && share < kMostSure;
        if (is_sure || (share > kDeepest && isCast(at, threshold, appearances))) shadow_.push_back(at);
      }
    }
  }
  for (const cv::Point& at : shadow_) appearances(at) = kLampShadow;
}

bool LampShadows::isCast(const cv::Point& from, Appearance threshold, const cv::Mat1b& appearances) const {
  cv::Point2f at(from);
  int on_floor = 0, on_object = 0;
  for (int step = 0; step < kSteps; ++step) {
    const cv::Point pixel(cvRound(at.x), cvRound(at.y));
    if (pixel.x < 0 || pixel.y < 0 || pixel.x >= appearances.cols || pixel.y >= appearances.rows)
      return false;
    const int y = std::min(pixel.y / kCell, towards_.rows - 1),
              x = std::min(pixel.x / kCell, towards_.cols - 1);
    if (view_->isOwnBody(pixel)) return true;
    if (view_->mask()(pixel) == 0 || towards_(y, x) == kNowhere) return false;
    const Appearance appearance = appearances(pixel);
    const bool is_object =
        appearance == kColourAppearance ||
        (isGrey(appearance) && (appearance < threshold || gainOf(appearance) > 1.0f + kFaintContrast));
    on_floor = appearance == kFloorAppearance ? on_floor + 1 : 0;
    on_object = is_object ? on_object + 1 : 0;
    if (on_object >= kConsecutive) return true;
    if (on_floor >= kConsecutive) return false;
    at += kStep_px * cv::Point2f(towards_(y, x));
  }
  return false;
}

}  // namespace omnifleet::ground
