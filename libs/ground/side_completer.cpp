#include "ground/side_completer.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::ground {

namespace {

constexpr int kCell = FloorView::kCell;
constexpr int kPatch_px = 5;
constexpr int kMinSide_px = 24;     // fewer tell no hue
constexpr float kSide = 0.9f;       // of the floor's light: more is no side in the shade
constexpr float kHue = 0.012f;      // share of the brightness by which a hue differs from the floor's
constexpr float kBrighter = 0.05f;  // of the floor's light, above which something is no floor
constexpr float kOther = 0.5f;      // of the floor's light, below which something is another thing
constexpr float kMinSolid = 0.88f;  // share of its hull that a thing fills
constexpr float kMaxReach = 0.75f;  // of the region's size that it grows to each side …
constexpr int kMinReach_px = 12;    // … and at least
// A top's colour is taken so far behind the side's end, which is mixed, and over so many pixels; how many
// bearings and pixels of them are enough.
constexpr int kBehind_px = 3, kDepth_px = 3;
constexpr std::size_t kLeastBearings = 8, kLeastSamples = 24;
constexpr float kLongest = 3.0f, kLonger_px = 20.0f;  // a top's length: times the side's, and more
constexpr int kMaxMisses = 3;                         // pixels of another colour that end it
constexpr std::uint8_t kGrown = 255, kAsked = 1;
// What counts as much of brightness and of hue, as shares of the floor's brightness; and how much of both
// together.
constexpr float kSameBright = 0.03f, kSameHue = 0.007f, kTold2 = 3.0f;

float medianOf(std::vector<float>& values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

/// Of a colour less the floor's, as shares of the floor's.
float brightOf(const cv::Vec3f& off) {
  return (off[0] + off[1] + off[2]) / 3.0f;
}
cv::Vec3f hueOf(const cv::Vec3f& off) {
  const float bright = brightOf(off), light = 1.0f / std::max(0.1f, 1.0f + bright);
  return light * (off - cv::Vec3f::all(bright));
}
/// In units of what counts.
cv::Vec3f whitened(const cv::Vec3f& off) {
  const float bright = brightOf(off);
  return cv::Vec3f::all(bright / kSameBright) + (off - cv::Vec3f::all(bright)) / kSameHue;
}

}  // namespace

SideCompleter::SideCompleter(const lens::Camera& camera, cv::Size image)
    : size_(image.width / kCell * kCell, image.height / kCell * kCell),
      means_(image),
      grown_(image),
      before_(image),
      firm_(image) {
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
  around_ = cv::Rect(side.rect.x - reach, side.rect.y - reach, side.rect.width + 2 * reach,
                     side.rect.height + 2 * reach) &
            cv::Rect({0, 0}, size_);
  cv::Mat3f means = means_(around_);
  cv::boxFilter(frame.shade.image(around_), means, CV_32F, cv::Size(kPatch_px, kPatch_px));
  if (!measureSide(frame, side)) return runs_;
  cv::Mat1b grown = grown_(around_);
  grown = std::uint8_t{0};
  for (const Run& run : side.runs)
    std::fill(grown_.ptr(run.row) + run.begin, grown_.ptr(run.row) + run.end, kGrown);
  learnTop(frame);
  if (has_top_) addTop(frame);
  grow(frame);
  if (!takeConvex(frame) && has_top_) take(before_);
  return runs_;
}

/// Colour around a pixel ÷ the floor's there, less 1.
cv::Vec3f SideCompleter::colourAt(const Frame& frame, int x, int y) const {
  const cv::Mat3f& floor = frame.shade.floor;
  const cv::Vec3f &p = means_(y, x),
                  &r = floor(std::min(y / kCell, floor.rows - 1), std::min(x / kCell, floor.cols - 1));
  cv::Vec3f off;
  for (int c = 0; c < 3; ++c) off[c] = p[c] / std::max(1.0f, r[c]) - 1.0f;
  return off;
}

int SideCompleter::bearingAt(float x, float y) const {
  const cv::Point2f to = cv::Point2f(x, y) - foot_px_;
  return cvRound(std::atan2(ahead_.cross(to), ahead_.dot(to)) / step_rad_) +
         static_cast<int>(bearings_.size() / 2);
}

/// Its hue, and where it begins and ends on each bearing. False where too little of it is in the shade.
bool SideCompleter::measureSide(const Frame& frame, const Blob& side) {
  const cv::Rect2f rect(side.rect);
  ahead_ = 0.5f * (rect.tl() + rect.br()) - foot_px_;
  const auto distance = std::max(1.0f, static_cast<float>(cv::norm(ahead_)));
  const float size = std::hypot(rect.width, rect.height);
  step_rad_ = 1.0f / distance;
  const auto half = static_cast<std::size_t>(std::ceil(std::atan2(size, distance) / step_rad_));
  bearings_.assign(2 * half + 1, {1e9f, -1.0f, -1.0f});
  side_hue_ = cv::Vec3f::all(0.0f);
  int count = 0;
  for (const Run& run : side.runs) {
    for (int x = run.begin; x < run.end; ++x) {
      const Look look = frame.looks(run.row, x);
      if (!isGrey(look) || gainOf(look) > kSide) continue;
      side_hue_ += hueOf(colourAt(frame, x, run.row));
      ++count;
      const cv::Point2f at(static_cast<float>(x), static_cast<float>(run.row));
      const int k = bearingAt(at.x, at.y);
      if (k < 0 || k >= static_cast<int>(bearings_.size())) continue;
      Bearing& bearing = bearings_[static_cast<std::size_t>(k)];
      const auto radius = static_cast<float>(cv::norm(at - foot_px_));
      bearing.near_px = std::min(bearing.near_px, radius);
      bearing.far_px = std::max(bearing.far_px, radius);
    }
  }
  side_hue_ *= 1.0f / static_cast<float>(std::max(1, count));
  has_hue_ = side_hue_.dot(side_hue_) > kHue * kHue;
  return count >= kMinSide_px;
}

/// Median colour right behind the side; none where it may be floor, or a shadow on it.
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
  // In less light and of the floor's hue it may be the thing's shadow; of another hue, another thing.
  if (!hued && brightOf(off) < kSameBright) return;
  if (hued && side2 > kSameHue * kSameHue && !(alike > 0.0f && alike * alike > 0.25f * hue2 * side2)) return;
  has_top_ = top_.dot(top_) > kTold2;
}

cv::Point SideCompleter::pixelAt(std::size_t k, float radius) const {
  const float angle = std::atan2(ahead_.y, ahead_.x) +
                      step_rad_ * (static_cast<float>(k) - static_cast<float>(bearings_.size() / 2));
  return {cvRound(foot_px_.x + radius * std::cos(angle)), cvRound(foot_px_.y + radius * std::sin(angle))};
}

/// How far the top goes on a bearing: while what is seen is nearer to its colour than to the floor's.
float SideCompleter::endOfTop(const Frame& frame, std::size_t k) const {
  const Bearing& bearing = bearings_[k];
  const float most = bearing.far_px + kLongest * (bearing.far_px - bearing.near_px) + kLonger_px;
  float end = bearing.far_px;
  int misses = 0;
  for (float radius = bearing.far_px + 1.0f; radius < most && misses <= kMaxMisses; radius += 1.0f) {
    const cv::Point at = pixelAt(k, radius);
    if (!around_.contains(at) || frame.view(at) == 0) break;
    const bool is_top =
        !isOther(frame, at) && whitened(colourAt(frame, at.x, at.y)).dot(top_) > 0.5f * top_.dot(top_);
    misses = is_top ? 0 : misses + 1;
    if (is_top) end = radius;
  }
  return end;
}

/// Fills from the middle of the side to the ends of the top, smoothed by a median over five bearings. Where
/// fewer than half of them show it there is none.
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
  for (cv::Point& point : outline_) point -= around_.tl();
  cv::Mat1b grown = grown_(around_);
  cv::fillPoly(grown, std::vector<std::vector<cv::Point>>{outline_}, cv::Scalar(kGrown));
  cv::bitwise_and(grown, frame.view(around_), grown);
}

/// What is plainly a thing of another colour.
bool SideCompleter::isOther(const Frame& frame, const cv::Point& at) {
  const Look look = frame.looks(at);
  return look == kColourLook || (isGrey(look) && gainOf(look) < kOther);
}

/// Floor or the same thing as the side?
bool SideCompleter::isLike(const Frame& frame, int x, int y) const {
  if (frame.view(y, x) == 0 || isOther(frame, {x, y})) return false;
  const cv::Vec3f off = colourAt(frame, x, y);
  if (brightOf(off) > kBrighter) return true;
  return has_hue_ && hueOf(off).dot(side_hue_) > 0.5f * side_hue_.dot(side_hue_);
}

void SideCompleter::grow(const Frame& frame) {
  cv::Mat1b grown = grown_(around_);
  grown.copyTo(before_(around_));
  queue_.clear();
  for (int y = around_.y; y < around_.y + around_.height; ++y)
    for (int x = around_.x; x < around_.x + around_.width; ++x)
      if (grown_(y, x) == kGrown) queue_.emplace_back(x, y);
  for (std::size_t i = 0; i < queue_.size(); ++i) {
    for (int dy = -1; dy <= 1; ++dy) {
      for (int dx = -1; dx <= 1; ++dx) {
        const cv::Point at = queue_[i] + cv::Point(dx, dy);
        if (!around_.contains(at) || grown_(at) != 0) continue;
        grown_(at) = kAsked;
        if (!isLike(frame, at.x, at.y)) continue;
        grown_(at) = kGrown;
        queue_.push_back(at);
      }
    }
  }
  cv::threshold(grown, grown, kAsked, kGrown, cv::THRESH_BINARY);
}

/// The hull of what was grown, without its fringe, where it fills it.
bool SideCompleter::takeConvex(const Frame& frame) {
  cv::Mat1b firm = firm_(around_);
  cv::morphologyEx(grown_(around_), firm, cv::MORPH_OPEN, cv::Mat1b::ones(kPatch_px, kPatch_px));
  std::vector<std::vector<cv::Point>> contours;
  cv::findContours(firm, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE);
  double most = 0.0;
  const std::vector<cv::Point>* largest = nullptr;
  for (const auto& contour : contours) {
    const double area = cv::contourArea(contour);
    if (area <= most) continue;
    most = area;
    largest = &contour;
  }
  if (largest == nullptr) return false;
  std::vector<cv::Point> hull;
  cv::convexHull(*largest, hull);
  if (most < static_cast<double>(kMinSolid) * cv::contourArea(hull)) return false;
  firm = std::uint8_t{0};
  cv::fillConvexPoly(firm, hull, cv::Scalar(kGrown));
  cv::bitwise_and(firm, frame.view(around_), firm);
  take(firm_);
  return true;
}

void SideCompleter::take(const cv::Mat1b& mask) {
  for (int y = around_.y; y < around_.y + around_.height; ++y) {
    const std::uint8_t* row = mask.ptr(y);
    const std::uint8_t* const stop = row + around_.x + around_.width;
    for (const auto* begin = std::find(row + around_.x, stop, kGrown); begin != stop;) {
      const auto* end = std::find(begin, stop, std::uint8_t{0});
      runs_.push_back({y, static_cast<int>(begin - row), static_cast<int>(end - row)});
      begin = std::find(end, stop, kGrown);
    }
  }
}

}  // namespace omnifleet::ground
