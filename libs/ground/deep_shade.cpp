#include "ground/deep_shade.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace omnifleet::ground {

namespace {

constexpr int kMinShade_px = 16;     // fewer pixels tell nothing
constexpr float kSharpShare = 0.5f;  // of the shade's depth, reached within one step
constexpr int kStepAtSide_px = 2;    // likewise, of a side beside the floor: shadows get deep in more
constexpr double kTowards = 0.5;     // cosine to the camera's foot, from which an outline lies on that side
constexpr int kBeyondEnd_px = 4;     // beside the end of deep shade, where nothing else must be
constexpr float kLighter = 1.1f;     // of the floor's light: more is no floor beside a side

// Where a side's foot is looked for on a bearing, from where its shade gets deep; the least step there, as a
// share of its depth; how many bearings must show one.
constexpr int kBeforeFoot_px = 4, kBehindFoot_px = 14;
constexpr float kLeastFoot = 0.3f;
constexpr std::size_t kLeastFeet = 8;
constexpr float kNoShadow = 0.94f;                      // of the floor's light, right before a foot
const Look kNothing = greyLook(1.0f + kFaintContrast);  // no fringe to leave out

float medianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

/// Where a region's shade is at least half as deep as half of it is: the fringe that fades into the floor's
/// brightness is left out. False where there is too little of it.
bool DeepShade::find(const Blob& blob, const cv::Mat1b& looks) {
  std::array<int, 256> pixels{};
  int shaded = 0;
  for (const Run& run : blob.runs) {
    const Look* row = looks.ptr(run.row);
    for (int x = run.begin; x < run.end; ++x) {
      if (!isShade(row[x], kDeepestShade) || isFaint(row[x])) continue;
      ++pixels[row[x]];
      ++shaded;
    }
  }
  if (shaded < kMinShade_px) return false;
  int look = 0;
  for (int below = pixels[0]; 2 * below < shaded; below += pixels[static_cast<std::size_t>(look)]) ++look;
  depth_ = 1.0f - gainOf(static_cast<Look>(look));
  const Look first = greyLook(kDeepestShade), last = greyLook(1.0f - 0.5f * depth_);
  const auto isDeep = [&](Look at) { return at >= first && at <= last; };
  const cv::Rect& rect = blob.rect;
  rows_.assign(static_cast<std::size_t>(rect.height), {looks.cols, -1});
  columns_.assign(static_cast<std::size_t>(rect.width), {looks.rows, -1});
  for (const Run& run : blob.runs) {
    if (run.row == 0 || run.row + 1 >= looks.rows) continue;
    const Look *above = looks.ptr(run.row - 1), *here = looks.ptr(run.row), *below = looks.ptr(run.row + 1);
    Extent& row = rows_[static_cast<std::size_t>(run.row - rect.y)];
    for (int x = std::max(run.begin, 1); x < std::min(run.end, looks.cols - 1); ++x) {
      if (!isDeep(here[x]) || !isDeep(here[x - 1]) || !isDeep(here[x + 1]) || !isDeep(above[x]) ||
          !isDeep(below[x]))
        continue;
      row = {std::min(row.first, x), x};
      Extent& column = columns_[static_cast<std::size_t>(x - rect.x)];
      column = {std::min(column.first, run.row), run.row};
    }
  }
  return true;
}

/// The deep shade's ends in each row and column, and which way out is.
template <typename Visit>
void DeepShade::forEnds(const Blob& blob, Visit visit) const {
  for (int i = 0; i < blob.rect.height; ++i) {
    const Extent& row = rows_[static_cast<std::size_t>(i)];
    if (row.last < 0) continue;
    visit(cv::Point(row.first, blob.rect.y + i), cv::Point(-1, 0));
    visit(cv::Point(row.last, blob.rect.y + i), cv::Point(1, 0));
  }
  for (int i = 0; i < blob.rect.width; ++i) {
    const Extent& column = columns_[static_cast<std::size_t>(i)];
    if (column.last < 0) continue;
    visit(cv::Point(blob.rect.x + i, column.first), cv::Point(0, -1));
    visit(cv::Point(blob.rect.x + i, column.last), cv::Point(0, 1));
  }
}

/// Share of the outline of a region's deep shade where it ends in a step, as a side does at verticals and at
/// its top, not as shadows fade. Towards the camera's foot both may end in a shadow; what is plainly no
/// floor, and what the view does not show, tells nothing.
float DeepShade::sharpShare(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& looks) {
  if (!find(blob, looks)) return 0.0f;
  const cv::Rect image({0, 0}, looks.size());
  const auto isThing = [](Look look) {
    return look == kColourLook || (isGrey(look) && (gainOf(look) < kDeepestShade || gainOf(look) > kLighter));
  };
  int sharp = 0, count = 0;
  forEnds(blob, [&](const cv::Point& end, const cv::Point& out) {
    for (int k = 1; k <= kBeyondEnd_px; ++k) {
      const cv::Point at = end + k * out;
      if (!image.contains(at) || frame.view(at) == 0 || isThing(looks(at))) return;
    }
    const int x = end.x + out.x, y = end.y + out.y;  // one more is as deep as that
    const cv::Point2f step(
        meanGain(frame, x + kStepAtSide_px, y, 0, 1) - meanGain(frame, x - kStepAtSide_px, y, 0, 1),
        meanGain(frame, x, y + kStepAtSide_px, 1, 0) - meanGain(frame, x, y - kStepAtSide_px, 1, 0));
    const cv::Point2f from_foot = cv::Point2f(end) - frame.foot_px;
    const double size = cv::norm(step);
    if (step.dot(from_foot) < -kTowards * size * cv::norm(from_foot)) return;
    sharp += size >= static_cast<double>(kSharpShare * depth_) ? 1 : 0;
    ++count;
  });
  return static_cast<float>(sharp) / static_cast<float>(std::max(1, count));
}

float DeepShade::footShare(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& looks) {
  if (!find(blob, looks)) return 0.0f;
  constexpr float kBefore_px = 4.0f, kBehind_px = 3.0f;
  int sharp = 0, count = 0;
  forEnds(blob, [&](const cv::Point& end, const cv::Point& out) {
    const cv::Point2f at(end), from_foot = at - frame.foot_px;
    const cv::Point2f away = from_foot / std::max(1.0f, static_cast<float>(cv::norm(from_foot)));
    if (away.dot(cv::Point2f(out)) > -0.5f) return;
    const cv::Point before = at - kBefore_px * away, behind = at + kBehind_px * away;
    const float step =
        meanGain(frame, before.x, before.y, out.y, out.x) - meanGain(frame, behind.x, behind.y, out.y, out.x);
    sharp += step >= kSharpShare * depth_ ? 1 : 0;
    ++count;
  });
  return static_cast<float>(sharp) / static_cast<float>(std::max(1, count));
}

/// A side's foot parts it from the shadow on the floor before it, which gets lighter from there on: halfway
/// up the steepest step on each bearing, the median of them all. What fades into the floor where there is
/// none.
Look DeepShade::foot(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& looks) {
  const Look faint = greyLook(1.0f - kFaintContrast);
  if (!find(blob, looks)) return faint;
  feet_.clear();
  before_feet_.clear();
  forEnds(blob, [&](const cv::Point& end, const cv::Point& out) {
    const cv::Point2f from_foot = cv::Point2f(end) - frame.foot_px;
    const auto distance = static_cast<float>(cv::norm(from_foot));
    const cv::Point2f away = from_foot / std::max(1.0f, distance);
    if (away.dot(cv::Point2f(out)) > -0.5f) return;
    const int across_x = std::abs(away.x) > std::abs(away.y) ? 0 : 1, across_y = 1 - across_x;
    profile_.clear();
    for (int k = -kBeforeFoot_px; k <= kBehindFoot_px; ++k) {
      const cv::Point at(cvRound(static_cast<float>(end.x) + static_cast<float>(k) * away.x),
                         cvRound(static_cast<float>(end.y) + static_cast<float>(k) * away.y));
      profile_.push_back(meanGain(frame, at.x, at.y, across_x, across_y));
    }
    float steepest = kLeastFoot * depth_, halfway = 0.0f, outside = 1.0f;
    for (std::size_t k = 2 * kStepAtSide_px; k < profile_.size(); ++k) {
      const float before = profile_[k - 2 * kStepAtSide_px], behind = profile_[k];
      if (before - behind <= steepest) continue;
      steepest = before - behind;
      halfway = 0.5f * (before + behind);
      outside = before;
    }
    if (halfway == 0.0f) return;
    feet_.push_back(halfway);
    before_feet_.push_back(outside);
  });
  if (feet_.size() < kLeastFeet) return faint;
  if (medianOf(before_feet_) > kNoShadow) return kNothing;
  return std::min(faint, greyLook(medianOf(feet_)));
}

}  // namespace omnifleet::ground
