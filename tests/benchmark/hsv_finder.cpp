#include "tests/benchmark/hsv_finder.h"

#include <cmath>
#include <opencv2/imgproc.hpp>

namespace omnifleet::bench {
namespace {

constexpr int kHueTolerance = 8;  // OpenCV hue, 0–179
constexpr double kDistanceTolerance_m = 0.02;

int hueOf(const dataset::Rgb& rgb) {
  cv::Mat3b pixel(1, 1, cv::Vec3b(rgb[2], rgb[1], rgb[0]));
  cv::cvtColor(pixel, pixel, cv::COLOR_BGR2HSV);
  return pixel(0, 0)[0];
}

}  // namespace

HsvFinder::HsvFinder(const lens::Camera& camera, const dataset::MarkerSet& markers)
    : camera_(camera), markers_(markers) {
  for (const auto& [robot, colours] : markers.robots) colours_.push_back({robot, hueOf(colours.individual)});
}

const std::map<std::string, Eigen::Vector2d>& HsvFinder::find(const cv::Mat3b& bgr) {
  const Eigen::Vector2d between = markers_.individual_offset_m - markers_.team_offset_m;
  cv::cvtColor(bgr, hsv_, cv::COLOR_BGR2HSV);
  patchesOf(hueOf(markers_.team), team_);
  found_.clear();
  for (const Colour& colour : colours_) {
    patchesOf(colour.hue, individual_);
    double best = kDistanceTolerance_m;
    for (const Eigen::Vector2d& team : team_) {
      for (const Eigen::Vector2d& individual : individual_) {
        const Eigen::Vector2d seen = individual - team;
        const double off = std::abs(seen.norm() - between.norm());
        if (off >= best) continue;
        best = off;
        const double turn = std::atan2(seen.y(), seen.x()) - std::atan2(between.y(), between.x());
        found_[colour.robot] = team - Eigen::Rotation2Dd(turn) * markers_.team_offset_m;
      }
    }
  }
  return found_;
}

void HsvFinder::patchesOf(int hue, std::vector<Eigen::Vector2d>& centres_m) {
  const auto range = [&](int from, int to, cv::Mat1b& mask) {
    cv::inRange(hsv_, cv::Scalar(from, 90, 50), cv::Scalar(to, 255, 255), mask);
  };
  range(std::max(0, hue - kHueTolerance), std::min(179, hue + kHueTolerance), mask_);
  if (hue < kHueTolerance || hue > 179 - kHueTolerance) {
    hue < kHueTolerance ? range(180 + hue - kHueTolerance, 179, wrapped_)
                        : range(0, hue + kHueTolerance - 180, wrapped_);
    cv::bitwise_or(mask_, wrapped_, mask_);
  }
  const int count = cv::connectedComponentsWithStats(mask_, labels_, statistics_, centroids_, 8, CV_32S);
  centres_m.clear();
  for (int n = 1; n < count; ++n) {
    if (statistics_.at<int>(n, cv::CC_STAT_AREA) < 60) continue;
    const Eigen::Vector2d pixel(centroids_.at<double>(n, 0), centroids_.at<double>(n, 1));
    if (const auto place = camera_.planeFromPixel(pixel, markers_.height_m)) centres_m.push_back(*place);
  }
}

}  // namespace omnifleet::bench
