#include "tests/benchmark/fairness.h"

#include <opencv2/imgproc.hpp>

namespace omnifleet::bench {
namespace {

constexpr double kNear_m = 2.0;      // distance of the contact: SilhouetteOptions::max_contact_m
constexpr int kLargeArea_px = 1500;  // 240 cm²

std::vector<cv::Point> onPlan(const Polygon& polygon, const NaiveMapper& naive) {
  std::vector<cv::Point> points;
  for (const Eigen::Vector2d& vertex : polygon) {
    const Eigen::Vector2d p = naive.remap().planFromFloor(vertex);
    points.emplace_back(cvRound(p.x()), cvRound(p.y()));
  }
  return points;
}

double nearest(const NaiveMapper::Region& region, const cv::Point& foot) {
  double least = 1e9;
  for (const cv::Point& p : region.hull) least = std::min(least, cv::norm(p - foot));
  return least;
}

}  // namespace

Agreement compare(const LocalMap& local_map, const NaiveMapper& naive,
                  const std::vector<NaiveMapper::Region>& regions) {
  Agreement agreement;
  cv::Mat1b naive_mask(naive.labels().size(), uchar(0)), hull_mask(naive_mask.size(), uchar(0)), one;
  for (const auto& region : regions) naive_mask.setTo(255, naive.labels() == region.label);
  for (const ObjectObservation& object : local_map.objects) {
    const auto outline = onPlan(object.hull_m, naive);
    cv::fillConvexPoly(hull_mask, outline, 255);
    if ((object.contact_m - local_map.scan.origin_m).norm() > kNear_m) continue;
    one = cv::Mat1b::zeros(naive_mask.size());
    cv::fillConvexPoly(one, outline, 255);
    const int area = cv::countNonZero(one);
    if (area < 0.5 * cv::contourArea(outline)) continue;
    ++agreement.objects;
    if (2 * cv::countNonZero(one & naive_mask) >= area) ++agreement.matched_objects;
  }
  const Eigen::Vector2d foot = naive.remap().planFromFloor(local_map.scan.origin_m);
  const double near_px =
      (naive.remap().planFromFloor(local_map.scan.origin_m + Eigen::Vector2d(kNear_m, 0)) - foot).norm();
  for (const auto& region : regions) {
    if (region.area_px < kLargeArea_px) continue;
    if (nearest(region, {cvRound(foot.x()), cvRound(foot.y())}) > near_px) continue;
    ++agreement.regions;
    const cv::Mat1b mask = naive.labels() == region.label;
    if (2 * cv::countNonZero(mask & hull_mask) >= region.area_px) ++agreement.matched_regions;
  }
  constexpr double kEqual_m = 0.1;
  for (std::size_t i = 0;
       i < local_map.scan.range_m.size() && local_map.scan.range_m.size() == naive.scan().size(); ++i) {
    if (local_map.scan.label[i] != RayLabel::kUnknown || local_map.scan.range_m[i] > kNear_m) continue;
    ++agreement.rays;
    if (std::abs(local_map.scan.range_m[i] - naive.scan()[i]) < kEqual_m) ++agreement.equal_rays;
  }
  return agreement;
}

}  // namespace omnifleet::bench
