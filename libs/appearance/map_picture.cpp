#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/imgproc.hpp>

#include "appearance/map_files.h"

namespace omnifleet::appearance {
namespace {

constexpr int kMargin_px = 40, kNode_px = 3, kHeading_px = 12;
const cv::Scalar kPaper(255, 255, 255), kStep(160, 120, 60), kLoop(40, 40, 220), kNode(60, 60, 60),
    kHeading(60, 160, 60);

/// Largest of 1, 2, 5 · 10^n that is at most `most`.
double roundLength(double most) {
  const double power = std::pow(10.0, std::floor(std::log10(most))), share = most / power;
  return power * (share >= 5.0 ? 5.0 : share >= 2.0 ? 2.0 : 1.0);
}

}  // namespace

cv::Mat3b drawMap(const std::vector<Place>& places, int size_px) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::max()), high = -low;
  for (const Place& place : places) {
    low = low.cwiseMin(place.frame_from_base.translation());
    high = high.cwiseMax(place.frame_from_base.translation());
  }
  if (places.empty()) low = high = Eigen::Vector2d::Zero();
  const Eigen::Vector2d extent = (high - low).cwiseMax(1e-9);
  const double per_metre = (size_px - 2 * kMargin_px) / extent.maxCoeff();
  const cv::Size size(static_cast<int>(extent.x() * per_metre) + 2 * kMargin_px,
                      static_cast<int>(extent.y() * per_metre) + 2 * kMargin_px);
  cv::Mat3b picture(std::max(size.height, 3 * kMargin_px), std::max(size.width, 6 * kMargin_px));
  picture.setTo(kPaper);
  const auto pixel = [&](const Eigen::Vector2d& p) {
    return cv::Point(kMargin_px + static_cast<int>((p.x() - low.x()) * per_metre),
                     kMargin_px + static_cast<int>((high.y() - p.y()) * per_metre));
  };
  for (const bool loops : {false, true}) {
    for (const Place& place : places) {
      for (const PlaceLink& link : place.links) {
        if (link.closes_loop != loops || link.robot != place.robot || link.index >= places.size()) continue;
        cv::line(picture, pixel(place.frame_from_base.translation()),
                 pixel(places[link.index].frame_from_base.translation()), loops ? kLoop : kStep, 1,
                 cv::LINE_AA);
      }
    }
  }
  for (const Place& place : places) {
    const cv::Point at = pixel(place.frame_from_base.translation());
    const double heading = place.frame_from_base.theta_rad;
    cv::line(picture, at,
             at + cv::Point(static_cast<int>(kHeading_px * std::cos(heading)),
                            static_cast<int>(-kHeading_px * std::sin(heading))),
             kHeading, 1, cv::LINE_AA);
    cv::circle(picture, at, kNode_px, kNode, cv::FILLED, cv::LINE_AA);
  }
  if (!places.empty()) {
    const double bar = roundLength(0.25 * (picture.cols - 2 * kMargin_px) / per_metre);
    const cv::Point begin(kMargin_px, picture.rows - kMargin_px / 3);
    cv::line(picture, begin, begin + cv::Point(static_cast<int>(bar * per_metre), 0), kNode, 2);
    cv::putText(picture, fmt::format("{:g} {}", bar, places.front().metric ? "m" : "units (no scale)"),
                begin + cv::Point(0, -6), cv::FONT_HERSHEY_SIMPLEX, 0.4, kNode, 1, cv::LINE_AA);
  }
  return picture;
}

}  // namespace omnifleet::appearance
