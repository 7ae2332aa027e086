#include "tests/benchmark/naive_mapper.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace omnifleet::bench {
namespace {

constexpr int kMinArea_px = 200, kMaxCorners = 500;
constexpr double kMaxReturn_px = 0.5;  // forward–backward error, as in the local mapper
constexpr double kMaxRatio = 3.0;      // vector length to median length of the region, as in the local mapper
constexpr double kMaxAngle_rad = 35.0 * M_PI / 180.0;  // from the median direction, as in the local mapper
constexpr double kStill_m = 0.01;                      // shorter vectors have no reliable direction
constexpr double kScanRange_m = 2.5;                   // as in the local mapper
constexpr int kPlan_px = 2 * 640;                      // covers the scan range on all sides
static_assert(kPlan_px / 2 * FloorRemap::kMetresPerPixel >= kScanRange_m);

double medianOf(std::vector<double> values) {
  const auto middle = values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2);
  std::nth_element(values.begin(), middle, values.end());
  return *middle;
}

}  // namespace

NaiveMapper::NaiveMapper(const lens::Camera& camera) : remap_(camera, {kPlan_px, kPlan_px}), scan_m_(kRays) {
  const double step = FloorRemap::kMetresPerPixel;
  cv::Mat2f map(kRays, static_cast<int>(kScanRange_m / step));
  const Eigen::Vector2d foot = camera.foot();
  for (int ray = 0; ray < map.rows; ++ray) {
    const double bearing = 2.0 * M_PI * ray / kRays;
    for (int k = 0; k < map.cols; ++k) {
      const Eigen::Vector2d out(std::cos(bearing), std::sin(bearing));
      const Eigen::Vector2d at = remap_.planFromFloor(foot + k * step * out);
      map(ray, k) = cv::Vec2f(static_cast<float>(at.x()), static_cast<float>(at.y()));
    }
  }
  cv::convertMaps(map, cv::noArray(), polar_map_, polar_fraction_, CV_16SC2, true);
}

const std::vector<NaiveMapper::Region>& NaiveMapper::process(const cv::Mat3b& bgr,
                                                             const Pose2& previous_from_current) {
  remap_.apply(bgr, plan_);
  removeGround();
  cv::connectedComponentsWithStats(objects_, labels_, statistics_, centroids_, 8, CV_32S);
  trackCorners();
  makeRegions();
  for (Region& region : regions_) filter(previous_from_current, region);
  makeScan();
  return regions_;
}

void NaiveMapper::removeGround() {
  const int channels[] = {0, 1}, bins[] = {30, 32};
  const float hue[] = {0, 180}, saturation[] = {0, 256};
  const float* ranges[] = {hue, saturation};
  cv::cvtColor(plan_, hsv_, cv::COLOR_BGR2HSV);
  cv::calcHist(&hsv_, 1, channels, remap_.seed(), histogram_, 2, bins, ranges);
  cv::normalize(histogram_, histogram_, 0, 255, cv::NORM_MINMAX);
  cv::calcBackProject(&hsv_, 1, channels, histogram_, ground_, ranges);
  cv::threshold(ground_, objects_, 2, 255, cv::THRESH_BINARY_INV);
  cv::bitwise_and(objects_, remap_.seen(), objects_);
  cv::medianBlur(objects_, objects_, 5);
}

void NaiveMapper::trackCorners() {
  cv::cvtColor(plan_, grey_, cv::COLOR_BGR2GRAY);
  cv::goodFeaturesToTrack(grey_, corners_, kMaxCorners, 0.01, 5, objects_, 3, true, 0.04);
  tracked_.assign(corners_.size(), 0);
  if (!previous_grey_.empty() && !corners_.empty()) {
    const cv::Size window(21, 21);
    cv::calcOpticalFlowPyrLK(grey_, previous_grey_, corners_, previous_corners_, tracked_, error_, window, 3);
    cv::calcOpticalFlowPyrLK(previous_grey_, grey_, previous_corners_, returned_, returned_status_, error_,
                             window, 3);
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const bool back = returned_status_[i] != 0 && cv::norm(returned_[i] - corners_[i]) <= kMaxReturn_px;
      tracked_[i] = tracked_[i] != 0 && back ? 1 : 0;
    }
  }
  grey_.copyTo(previous_grey_);
}

void NaiveMapper::makeRegions() {
  std::vector<int> region_of(static_cast<std::size_t>(statistics_.rows), -1);
  std::vector<std::vector<cv::Point>> contours;
  regions_.clear();
  for (int n = 1; n < statistics_.rows; ++n) {
    const int area = statistics_.at<int>(n, cv::CC_STAT_AREA);
    if (area < kMinArea_px) continue;
    region_of[static_cast<std::size_t>(n)] = static_cast<int>(regions_.size());
    regions_.push_back({n, area, {}, {}, {}, {}});
    const cv::Rect box(statistics_.at<int>(n, cv::CC_STAT_LEFT), statistics_.at<int>(n, cv::CC_STAT_TOP),
                       statistics_.at<int>(n, cv::CC_STAT_WIDTH), statistics_.at<int>(n, cv::CC_STAT_HEIGHT));
    const cv::Mat1b mask = labels_(box) == n;
    cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE, box.tl());
    if (contours.empty()) continue;
    cv::convexHull(contours.front(), regions_.back().hull);
    for (const cv::Point& p : regions_.back().hull)
      regions_.back().hull_m.push_back(remap_.floorFromPlan({p.x, p.y}));
  }
  sortCorners(region_of);
}

void NaiveMapper::sortCorners(const std::vector<int>& region_of) {
  const auto floor = [&](const cv::Point2f& p) { return remap_.floorFromPlan({p.x, p.y}); };
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const int n = region_of[static_cast<std::size_t>(labels_(cv::Point(corners_[i])))];
    if (n < 0 || !tracked_[i]) continue;
    regions_[static_cast<std::size_t>(n)].from_m.push_back(floor(previous_corners_[i]));
    regions_[static_cast<std::size_t>(n)].to_m.push_back(floor(corners_[i]));
  }
}

/// Removes the robot's own motion, then drops vectors that differ from the median of the region.
void NaiveMapper::filter(const Pose2& previous_from_current, Region& region) {
  if (region.to_m.empty()) return;
  const Pose2 current_from_previous = previous_from_current.inverse();
  std::vector<Eigen::Vector2d> moved;
  std::vector<double> lengths, xs, ys;
  for (std::size_t i = 0; i < region.to_m.size(); ++i) {
    moved.push_back(region.to_m[i] - current_from_previous * region.from_m[i]);
    lengths.push_back(moved.back().norm());
    xs.push_back(moved.back().x());
    ys.push_back(moved.back().y());
  }
  const double length = medianOf(lengths), direction = std::atan2(medianOf(ys), medianOf(xs));
  std::size_t kept = 0;
  for (std::size_t i = 0; i < moved.size(); ++i) {
    const bool has_direction = lengths[i] > kStill_m;
    const double turn = std::remainder(std::atan2(ys[i], xs[i]) - direction, 2.0 * M_PI);
    if (has_direction && (lengths[i] > kMaxRatio * length || std::abs(turn) > kMaxAngle_rad)) continue;
    region.from_m[kept] = region.from_m[i];
    region.to_m[kept++] = region.to_m[i];
  }
  region.from_m.resize(kept);
  region.to_m.resize(kept);
}

void NaiveMapper::makeScan() {
  cv::remap(objects_, polar_, polar_map_, polar_fraction_, cv::INTER_NEAREST, cv::BORDER_CONSTANT, 1);
  for (int ray = 0; ray < kRays; ++ray) {
    const std::uint8_t* row = polar_.ptr(ray);
    const auto first = std::find_if(row, row + polar_.cols, [](std::uint8_t v) { return v != 0; }) - row;
    scan_m_[static_cast<std::size_t>(ray)] = static_cast<double>(first) * FloorRemap::kMetresPerPixel;
  }
}

}  // namespace omnifleet::bench
