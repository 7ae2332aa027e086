#include "tests/benchmark/naive_mapper.h"

#include <opencv2/imgproc.hpp>
#include <opencv2/video/tracking.hpp>

namespace omnifleet::bench {
namespace {

constexpr int kMinArea_px = 200, kMaxCorners = 500;
constexpr double kMaxReturn_px = 0.5;  // forward–backward error, as ours

}  // namespace

const std::vector<NaiveMapper::Region>& NaiveMapper::process(const cv::Mat3b& bgr) {
  remap_.apply(bgr, plan_);
  removeGround();
  cv::connectedComponentsWithStats(objects_, labels_, statistics_, centroids_, 8, CV_32S);
  follow();
  makeRegions();
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

void NaiveMapper::follow() {
  cv::cvtColor(plan_, grey_, cv::COLOR_BGR2GRAY);
  cv::goodFeaturesToTrack(grey_, corners_, kMaxCorners, 0.01, 5, cv::noArray(), 3, true, 0.04);
  followed_.assign(corners_.size(), 0);
  if (!previous_grey_.empty() && !corners_.empty()) {
    const cv::Size window(21, 21);
    cv::calcOpticalFlowPyrLK(grey_, previous_grey_, corners_, previous_corners_, followed_, error_, window,
                             3);
    cv::calcOpticalFlowPyrLK(previous_grey_, grey_, previous_corners_, returned_, returned_well_, error_,
                             window, 3);
    for (std::size_t i = 0; i < corners_.size(); ++i) {
      const bool back = returned_well_[i] != 0 && cv::norm(returned_[i] - corners_[i]) <= kMaxReturn_px;
      followed_[i] = followed_[i] != 0 && back ? 1 : 0;
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
    regions_.push_back({n, area, {}, {}, {}});
    const cv::Rect box(statistics_.at<int>(n, cv::CC_STAT_LEFT), statistics_.at<int>(n, cv::CC_STAT_TOP),
                       statistics_.at<int>(n, cv::CC_STAT_WIDTH), statistics_.at<int>(n, cv::CC_STAT_HEIGHT));
    const cv::Mat1b mask = labels_(box) == n;
    cv::findContours(mask, contours, cv::RETR_EXTERNAL, cv::CHAIN_APPROX_NONE, box.tl());
    if (!contours.empty()) cv::convexHull(contours.front(), regions_.back().hull);
  }
  sortCorners(region_of);
}

void NaiveMapper::sortCorners(const std::vector<int>& region_of) {
  const auto floor = [&](const cv::Point2f& p) { return remap_.floorFromPlan({p.x, p.y}); };
  for (std::size_t i = 0; i < corners_.size(); ++i) {
    const int n = region_of[static_cast<std::size_t>(labels_(cv::Point(corners_[i])))];
    if (n < 0 || !followed_[i]) continue;
    regions_[static_cast<std::size_t>(n)].from_m.push_back(floor(previous_corners_[i]));
    regions_[static_cast<std::size_t>(n)].to_m.push_back(floor(corners_[i]));
  }
}

}  // namespace omnifleet::bench
