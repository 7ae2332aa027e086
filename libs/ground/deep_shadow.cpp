#include "ground/deep_shadow.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace omnifleet::ground {

namespace {

constexpr int kMinShadow_px = 16;    // minimum number of pixels for a decision
constexpr float kSharpShare = 0.5f;  // share of the shadow's depth that a sharp edge reaches in one step
constexpr int kStepAtSide_px = 2;    // half the width of a step; shadow edges are wider
constexpr double kTowards =
    0.5;  // cosine between step and direction to the camera's foot: outline on that side
constexpr int kBeyondEnd_px = 4;  // pixels beside the end of the deep shadow that must be free of objects
constexpr float kLighter = 1.1f;  // share of the floor's brightness; brighter pixels are no floor

// Search range for the foot of a side along a bearing, relative to the begin of its deep shadow. Minimum
// intensity step there, as a share of the depth. Minimum number of bearings that show a step.
constexpr int kBeforeFoot_px = 4, kBehindFoot_px = 14;
constexpr float kLeastFoot = 0.3f;
constexpr std::size_t kLeastFeet = 8;
constexpr float kNoShadow = 0.94f;  // share of the floor's brightness right before a foot
const Appearance kNothing = greyAppearance(1.0f + kFaintContrast);  // no fringe to exclude

float medianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

/// Finds where a region's shadow is at least half as deep as its median depth. This excludes the fringe that
/// fades into the floor's brightness. Returns false if there are too few such pixels.
bool DeepShadow::find(const Blob& blob, const cv::Mat1b& appearances) {
  std::array<int, 256> pixels{};
  int shadowed = 0;
  for (const Run& run : blob.runs) {
    const Appearance* row = appearances.ptr(run.row);
    for (int x = run.begin; x < run.end; ++x) {
      if (!isShadow(row[x], kDeepestShadow) || isFaint(row[x])) continue;
      ++pixels[row[x]];
      ++shadowed;
    }
  }
  if (shadowed < kMinShadow_px) return false;
  int appearance = 0;
  for (int below = pixels[0]; 2 * below < shadowed; below += pixels[static_cast<std::size_t>(appearance)])
    ++appearance;
  depth_ = 1.0f - gainOf(static_cast<Appearance>(appearance));
  const Appearance first = greyAppearance(kDeepestShadow), last = greyAppearance(1.0f - 0.5f * depth_);
  const auto isDeep = [&](Appearance at) { return at >= first && at <= last; };
  const cv::Rect& rect = blob.rect;
  rows_.assign(static_cast<std::size_t>(rect.height), {appearances.cols, -1});
  columns_.assign(static_cast<std::size_t>(rect.width), {appearances.rows, -1});
  for (const Run& run : blob.runs) {
    if (run.row == 0 || run.row + 1 >= appearances.rows) continue;
    const Appearance *above = appearances.ptr(run.row - 1), *here = appearances.ptr(run.row),
                     *below = appearances.ptr(run.row + 1);
    Extent& row = rows_[static_cast<std::size_t>(run.row - rect.y)];
    for (int x = std::max(run.begin, 1); x < std::min(run.end, appearances.cols - 1); ++x) {
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

/// Calls visit(end, outward step) for both ends of the deep shadow in each row and column.
template <typename Visit>
void DeepShadow::forEnds(const Blob& blob, Visit visit) const {
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

/// Share of the outline of the deep shadow that ends in an intensity step, as the vertical edges and the top
/// of an object's side do. Shadows on the floor fade. The outline towards the camera's foot is excluded, as
/// both kinds may end in a shadow there. Places next to an object or outside the view are excluded too.
float DeepShadow::sharpShare(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& appearances) {
  if (!find(blob, appearances)) return 0.0f;
  const cv::Rect image({0, 0}, appearances.size());
  const auto isObject = [](Appearance appearance) {
    return appearance == kColourAppearance ||
           (isGrey(appearance) && (gainOf(appearance) < kDeepestShadow || gainOf(appearance) > kLighter));
  };
  int sharp = 0, count = 0;
  forEnds(blob, [&](const cv::Point& end, const cv::Point& out) {
    for (int k = 1; k <= kBeyondEnd_px; ++k) {
      const cv::Point at = end + k * out;
      if (!image.contains(at) || frame.view(at) == 0 || isObject(appearances(at))) return;
    }
    const int x = end.x + out.x, y = end.y + out.y;  // neighbours inside the end are as deep
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

float DeepShadow::footShare(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& appearances) {
  if (!find(blob, appearances)) return 0.0f;
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

/// Brightness at the foot of a side. The foot separates the side from the shadow on the floor before it,
/// which gets brighter outward. Takes the middle of the steepest step on each bearing, then the median over
/// the bearings. Without a step, returns the brightness at which shadows fade into the floor.
Appearance DeepShadow::foot(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& appearances) {
  const Appearance faint = greyAppearance(1.0f - kFaintContrast);
  if (!find(blob, appearances)) return faint;
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
  return std::min(faint, greyAppearance(medianOf(feet_)));
}

}  // namespace omnifleet::ground
