#include "ground/side_completer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kPatch_px = 2 * PatchSums::kRadius_px + 1;
constexpr int kMinSide_px = 24;  // fewer pixels have no reliable hue
constexpr float kSide = 0.9f;    // share of the floor's light; with more it is no side in shadow
constexpr float kHue = 0.012f;   // minimum difference of a hue from the floor's, as a share of the brightness
constexpr float kBrighter = 0.05f;  // share of the floor's light by which something brighter is not floor
constexpr float kOther = 0.5f;  // share of the floor's light, below which a pixel belongs to another object
constexpr float kMinSolid = 0.88f;  // share of its hull that an object fills
constexpr float kMaxReach = 1.5f;   // multiple of the region's size by which it may grow to each side
constexpr double kMinMore = 1.1;    // minimum area of the whole object, as a multiple of the side's
constexpr int kMinReach_px = 12;    // minimum of that growth
constexpr int kEdge_px = 4;         // what comes this close to the limit of the search does not end by itself
// The colour of a top is sampled this far behind the end of the side, which is mixed, and over this many
// pixels. Below them: the minimum number of bearings and samples.
constexpr int kBehind_px = 3, kDepth_px = 3;
constexpr std::size_t kLeastBearings = 8, kLeastSamples = 24;
constexpr float kLongest = 3.0f,
                kLonger_px = 20.0f;  // greatest length of a top: multiple of the side's, plus pixels
constexpr int kMaxMisses = 3;        // pixels of another colour that end the top
constexpr std::uint8_t kGrown = 255, kTested = 1;
// Least significant differences in brightness and in hue, as shares of the floor's brightness, and the least
// squared norm of both together.
constexpr float kSameBright = 0.03f, kSameHue = 0.007f, kMinNorm2 = 3.0f;
// Multiple of the noise of a patch mean, from which a colour separates most patches from the floor's.
constexpr float kSharpEnough = 0.67f;

float medianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Of a colour's difference from the floor's, as shares of the floor's.
float brightOf(const cv::Vec3f& off) {
  return (off[0] + off[1] + off[2]) / 3.0f;
}
cv::Vec3f hueOf(const cv::Vec3f& off) {
  const float bright = brightOf(off), light = 1.0f / std::max(0.1f, 1.0f + bright);
  return light * (off - cv::Vec3f::all(bright));
}
/// In units of the least significant differences.
cv::Vec3f whitened(const cv::Vec3f& off) {
  const float bright = brightOf(off);
  return cv::Vec3f::all(bright / kSameBright) + (off - cv::Vec3f::all(bright)) / kSameHue;
}

}  // namespace

SideCompleter::SideCompleter(const lens::Camera& camera, cv::Size image)
    : size_(image.width / kCell * kCell, image.height / kCell * kCell),
      sums_(image),
      grown_(image, std::uint8_t{0}),
      whole_(image, std::uint8_t{0}),
      convex_(image) {
  const Eigen::Vector2d foot = camera.foot();
  const auto pixel = camera.pixelFromPoint({foot.x(), foot.y(), 0.0});
  foot_px_ =
      pixel ? cv::Point2f(static_cast<float>(pixel->x()), static_cast<float>(pixel->y()))
            : cv::Point2f(0.5f * static_cast<float>(image.width), 0.5f * static_cast<float>(image.height));
}

const std::vector<Run>& SideCompleter::complete(const Frame& frame, const Blob& side) {
  runs_.clear();
  const int reach =
      std::max(kMinReach_px,
               static_cast<int>(kMaxReach * static_cast<float>(std::max(side.rect.width, side.rect.height))));
  setSearchArea(side.rect, reach);
  sums_.read(frame.shadow.image, around_);
  if (!measureSide(frame, side)) return runs_;
  for (int y = around_.y; y < around_.y + around_.height; ++y)
    std::fill_n(grown_.ptr(y) + around_.x, around_.width, std::uint8_t{0});
  box_ = side.rect & around_;
  int area = 0;
  for (const Run& run : side.runs) {
    for (int x = run.begin; x < run.end; ++x) area += frame.found.at(x, run.row) ? 1 : 0;
    if (run.row < around_.y || run.row >= around_.y + around_.height) continue;
    std::uint8_t* row = grown_.ptr(run.row);
    const int end = std::min(run.end, around_.x + around_.width);
    for (int x = std::max(run.begin, around_.x); x < end; ++x)
      if (frame.found.at(x, run.row)) row[x] = kGrown;
  }
  learnTop(frame);
  if (has_top_) addTop(frame);
  hull_.clear();
  if (has_top_) keepConvex();
  grow(frame);
  keepConvex();
  if (!hull_.empty() && cv::contourArea(hull_) > kMinMore * area) take(frame.view);
  return runs_;
}

/// Sets around_ to the region and `reach` pixels to each side of it, as far as there are means.
void SideCompleter::setSearchArea(const cv::Rect& region, int reach) {
  constexpr int kMargin = PatchSums::kRadius_px;
  const cv::Rect usable(kMargin, kMargin, size_.width - 2 * kMargin, size_.height - 2 * kMargin);
  const cv::Rect all(region.x - reach, region.y - reach, region.width + 2 * reach, region.height + 2 * reach);
  around_ = all & usable;
  const int left = around_.x == all.x ? kEdge_px : 0, top = around_.y == all.y ? kEdge_px : 0,
            right = around_.br().x == all.br().x ? kEdge_px : 0,
            bottom = around_.br().y == all.br().y ? kEdge_px : 0;
  free_ = cv::Rect(around_.x + left, around_.y + top, around_.width - left - right,
                   around_.height - top - bottom);
}

/// Mean colour around a pixel ÷ the floor's there, minus 1.
cv::Vec3f SideCompleter::colourAt(const Frame& frame, int x, int y) const {
  const cv::Mat3f& floor = frame.shadow.floor;
  const cv::Vec3f p = sums_.mean(x, y);
  const cv::Vec3f& r = floor(std::min(y / kCell, floor.rows - 1), std::min(x / kCell, floor.cols - 1));
  cv::Vec3f off;
  for (int c = 0; c < 3; ++c) off[c] = p[c] / std::max(1.0f, r[c]) - 1.0f;
  return off;
}

/// Noise of the mean of a patch, as a share of the floor's brightness in the region.
float SideCompleter::noiseAt(const Frame& frame, const cv::Rect& region) {
  const cv::Mat3f& floor = frame.shadow.floor;
  const cv::Point middle = (region.tl() + region.br()) / 2;
  const cv::Vec3f& r =
      floor(std::min(middle.y / kCell, floor.rows - 1), std::min(middle.x / kCell, floor.cols - 1));
  return 3.0f * frame.shadow.noise / (kPatch_px * std::max(1.0f, r[0] + r[1] + r[2]));
}

int SideCompleter::bearingAt(float x, float y) const {
  const cv::Point2f to = cv::Point2f(x, y) - foot_px_;
  return cvRound(std::atan2(ahead_.cross(to), ahead_.dot(to)) / step_rad_) +
         static_cast<int>(bearings_.size() / 2);
}

/// Measures the hue of the side, and where it begins and ends on each bearing. @return false where too little
/// of it is in shadow
bool SideCompleter::measureSide(const Frame& frame, const Blob& side) {
  const cv::Rect2f rect(side.rect);
  ahead_ = 0.5f * (rect.tl() + rect.br()) - foot_px_;
  const auto distance = std::max(1.0f, static_cast<float>(cv::norm(ahead_)));
  const float size = std::hypot(rect.width, rect.height);
  step_rad_ = 1.0f / distance;
  noise_ = noiseAt(frame, side.rect);
  const auto half = static_cast<std::size_t>(std::ceil(std::atan2(size, distance) / step_rad_));
  bearings_.assign(2 * half + 1, {1e9f, -1.0f, -1.0f});
  side_hue_ = cv::Vec3f::all(0.0f);
  int count = 0;
  for (const Run& run : side.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      const Appearance appearance = frame.appearances(run.row, x);
      if (!isGrey(appearance) || gainOf(appearance) > kSide || !around_.contains({x, run.row})) continue;
      if (!frame.found.at(x, run.row)) continue;
      side_hue_ += hueOf(colourAt(frame, x, run.row));
      ++count;
      const cv::Point2f at(static_cast<float>(x), static_cast<float>(run.row));
      const int k = bearingAt(at.x, at.y);
      if (k < 0 || k >= static_cast<int>(bearings_.size())) continue;
      Bearing& bearing = bearings_[static_cast<std::size_t>(k)];
      const float radius = std::sqrt((at - foot_px_).dot(at - foot_px_));
      bearing.near_px = std::min(bearing.near_px, radius);
      bearing.far_px = std::max(bearing.far_px, radius);
    }
  }
  side_hue_ *= 1.0f / static_cast<float>(std::max(1, count));
  const float threshold = std::max(kHue, noise_);
  has_hue_ = side_hue_.dot(side_hue_) > threshold * threshold;
  return count >= kMinSide_px;
}

/// Computes the median colour right behind the side. There is no top where this may be floor, or a shadow on
/// it.
void SideCompleter::learnTop(const Frame& frame) {
  for (auto& values : channel_) values.clear();
  for (std::size_t k = 0; k < bearings_.size(); ++k) {
    const Bearing& bearing = bearings_[k];
    if (bearing.far_px < bearing.near_px) continue;
    for (int i = 0; i < kDepth_px; ++i) {
      const cv::Point at = pixelAt(k, bearing.far_px + static_cast<float>(kBehind_px + i));
      if (!around_.contains(at) || frame.view(at) == 0) continue;
      const cv::Vec3f off = colourAt(frame, at.x, at.y);
      for (int c = 0; c < 3; ++c) channel_[c].push_back(off[c]);
    }
  }
  has_top_ = false;
  if (channel_[0].size() < kLeastSamples) return;
  const cv::Vec3f off(medianOf(channel_[0]), medianOf(channel_[1]), medianOf(channel_[2]));
  top_ = whitened(off);
  const cv::Vec3f hue = hueOf(off);
  const float hue2 = hue.dot(hue), side2 = side_hue_.dot(side_hue_), alike = hue.dot(side_hue_);
  const bool hued = hue2 > kSameHue * kSameHue;
  // In less light and of the floor's hue it may be the object's shadow. Of another hue it is another object.
  if (!hued && brightOf(off) < kSameBright) return;
  if (hued && side2 > kSameHue * kSameHue && !(alike > 0.0f && alike * alike > 0.25f * hue2 * side2)) return;
  const float threshold = kSharpEnough * noise_ / kSameHue;
  has_top_ = top_.dot(top_) > std::max(kMinNorm2, threshold * threshold);
}

cv::Point SideCompleter::pixelAt(std::size_t k, float radius) const {
  const float angle = std::atan2(ahead_.y, ahead_.x) +
                      step_rad_ * (static_cast<float>(k) - static_cast<float>(bearings_.size() / 2));
  return {cvRound(foot_px_.x + radius * std::cos(angle)), cvRound(foot_px_.y + radius * std::sin(angle))};
}

/// End of the top on a bearing: it extends while the colour is closer to the top's than to the floor's. If
/// the colour does not end, there is no top.
float SideCompleter::endOfTop(const Frame& frame, std::size_t k) const {
  const Bearing& bearing = bearings_[k];
  const float most = bearing.far_px + kLongest * (bearing.far_px - bearing.near_px) + kLonger_px;
  float end = bearing.far_px;
  int misses = 0;
  for (float radius = bearing.far_px + 1.0f; misses <= kMaxMisses; radius += 1.0f) {
    const cv::Point at = pixelAt(k, radius);
    if (radius >= most || !around_.contains(at)) return bearing.far_px;
    if (frame.view(at) == 0) break;
    const bool is_top =
        !isOther(frame, at) && whitened(colourAt(frame, at.x, at.y)).dot(top_) > 0.5f * top_.dot(top_);
    misses = is_top ? 0 : misses + 1;
    if (is_top) end = radius;
  }
  return end;
}

/// Fills the area from the middle of the side to the ends of the top, smoothed by a median over five
/// bearings. There is no top where fewer than half of the bearings show it.
void SideCompleter::addTop(const Frame& frame) {
  used_.clear();
  std::size_t found = 0;
  for (std::size_t k = 0; k < bearings_.size(); ++k) {
    Bearing& bearing = bearings_[k];
    if (bearing.far_px < bearing.near_px) continue;
    bearing.end_px = endOfTop(frame, k);
    found += bearing.end_px > bearing.far_px + static_cast<float>(kBehind_px) ? 1 : 0;
    used_.push_back(k);
  }
  has_top_ = used_.size() >= kLeastBearings && 2 * found >= used_.size();
  if (!has_top_) return;
  outline_.clear();
  for (const std::size_t k : used_)
    outline_.push_back(pixelAt(k, 0.5f * (bearings_[k].near_px + bearings_[k].far_px)));
  for (std::size_t i = used_.size(); i-- > 0;) {
    ends_.clear();
    for (std::size_t j = i < 2 ? 0 : i - 2; j < std::min(used_.size(), i + 3); ++j)
      ends_.push_back(bearings_[used_[j]].end_px);
    outline_.push_back(pixelAt(used_[i], medianOf(ends_)));
  }
  box_ |= paint(outline_, frame.view, grown_);
}

/// Plainly an object of another colour.
bool SideCompleter::isOther(const Frame& frame, const cv::Point& at) {
  const Appearance appearance = frame.appearances(at);
  return appearance == kColourAppearance || (isGrey(appearance) && gainOf(appearance) < kOther);
}

/// Does the pixel belong to the same object as the side, rather than to the floor?
bool SideCompleter::isLike(const Frame& frame, int x, int y) const {
  if (frame.view(y, x) == 0 || isOther(frame, {x, y})) return false;
  const cv::Vec3f off = colourAt(frame, x, y);
  if (brightOf(off) > kBrighter) return true;
  return has_hue_ && hueOf(off).dot(side_hue_) > 0.5f * side_hue_.dot(side_hue_);
}

bool SideCompleter::isRim(const cv::Point& at) const {
  for (int dy = -1; dy <= 1; ++dy)
    for (int dx = -1; dx <= 1; ++dx)
      if (const cv::Point next(at.x + dx, at.y + dy); around_.contains(next) && grown_(next) != kGrown)
        return true;
  return false;
}

void SideCompleter::grow(const Frame& frame) {
  queue_.clear();
  for (int y = box_.y; y < box_.y + box_.height; ++y)
    for (int x = box_.x; x < box_.x + box_.width; ++x)
      if (grown_(y, x) == kGrown && isRim({x, y})) queue_.emplace_back(x, y);
  cv::Point first = box_.tl(), end = box_.br();
  for (std::size_t i = 0; i < queue_.size(); ++i) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const cv::Point at = queue_[i] + cv::Point(dx, dy);
        if (!around_.contains(at) || grown_(at) != 0) continue;
        grown_(at) = kTested;
        if (!isLike(frame, at.x, at.y)) continue;
        grown_(at) = kGrown;
        queue_.push_back(at);
        first = {std::min(first.x, at.x), std::min(first.y, at.y)};
        end = {std::max(end.x, at.x + 1), std::max(end.y, at.y + 1)};
      }
    }
  }
  box_ = cv::Rect(first, end);
}

/// Sets the hull of what has grown, without its fringe, if that fills the hull and ends by itself.
void SideCompleter::keepConvex() {
  constexpr int kMargin = PatchSums::kRadius_px;
  const cv::Rect within(box_.x - kMargin, box_.y - kMargin, box_.width + 2 * kMargin,
                        box_.height + 2 * kMargin);
  if (!convex_.find(grown_, within & around_, kMinSolid)) return;
  const std::vector<cv::Point>& hull = convex_.hull();
  const auto isFree = [this](const cv::Point& point) { return free_.contains(point); };
  if (std::all_of(hull.begin(), hull.end(), isFree)) hull_ = hull;
}

/// Sets the pixels of a polygon that lie in the view.
/// @return the polygon's bounding rectangle
cv::Rect SideCompleter::paint(const std::vector<cv::Point>& polygon, const cv::Mat1b& view,
                              cv::Mat1b& mask) const {
  cv::Mat1b part = mask(around_);
  const cv::Point* points = polygon.data();
  const int count = static_cast<int>(polygon.size());
  cv::fillPoly(part, &points, &count, 1, cv::Scalar(kGrown), cv::LINE_8, 0, -around_.tl());
  const cv::Rect box = cv::boundingRect(polygon) & around_;
  for (int y = box.y; y < box.y + box.height; ++y)
    for (int x = box.x; x < box.x + box.width; ++x)
      if (view(y, x) == 0) mask(y, x) = 0;
  return box;
}

void SideCompleter::take(const cv::Mat1b& view) {
  const cv::Rect box = cv::boundingRect(hull_) & around_;
  for (int y = box.y; y < box.y + box.height; ++y)
    std::fill_n(whole_.ptr(y) + box.x, box.width, std::uint8_t{0});
  paint(hull_, view, whole_);
  for (int y = box.y; y < box.y + box.height; ++y) {
    const std::uint8_t* row = whole_.ptr(y);
    const std::uint8_t* const stop = row + box.x + box.width;
    for (const auto* begin = std::find(row + box.x, stop, kGrown); begin != stop;) {
      const auto* end = std::find(begin, stop, std::uint8_t{0});
      runs_.push_back({y, static_cast<int>(begin - row), static_cast<int>(end - row)});
      begin = std::find(end, stop, kGrown);
    }
  }
}

}  // namespace omnifleet::ground
