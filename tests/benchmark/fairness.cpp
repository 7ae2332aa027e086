#include "tests/benchmark/fairness.h"

#include <opencv2/imgproc.hpp>

namespace omnifleet::bench {
namespace {

constexpr double kNear_m = 2.0;      // contact with the floor: ours tells of nothing beyond
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

Agreement compare(const LocalMap& ours, const NaiveMapper& naive,
                  const std::vector<NaiveMapper::Region>& regions) {
  Agreement agreement;
  cv::Mat1b theirs(naive.labels().size(), uchar(0)), all(theirs.size(), uchar(0)), one;
  for (const auto& region : regions) theirs.setTo(255, naive.labels() == region.label);
  for (const ObjectObservation& object : ours.objects) {
    const auto outline = onPlan(object.hull_m, naive);
    cv::fillConvexPoly(all, outline, 255);
    if ((object.contact_m - ours.scan.origin_m).norm() > kNear_m) continue;
    one = cv::Mat1b::zeros(theirs.size());
    cv::fillConvexPoly(one, outline, 255);
    const int area = cv::countNonZero(one);
    if (area < 0.5 * cv::contourArea(outline)) continue;
    ++agreement.objects;
    if (2 * cv::countNonZero(one & theirs) >= area) ++agreement.found;
  }
  const Eigen::Vector2d foot = naive.remap().planFromFloor(ours.scan.origin_m);
  const double near_px =
      (naive.remap().planFromFloor(ours.scan.origin_m + Eigen::Vector2d(kNear_m, 0)) - foot).norm();
  for (const auto& region : regions) {
    if (region.area_px < kLargeArea_px) continue;
    if (nearest(region, {cvRound(foot.x()), cvRound(foot.y())}) > near_px) continue;
    ++agreement.regions;
    const cv::Mat1b mask = naive.labels() == region.label;
    if (2 * cv::countNonZero(mask & all) >= region.area_px) ++agreement.known;
  }
  constexpr double kAlike_m = 0.1;
  for (std::size_t i = 0; i < ours.scan.range_m.size() && ours.scan.range_m.size() == naive.scan().size();
       ++i) {
    if (ours.scan.label[i] != RayLabel::kUnknown || ours.scan.range_m[i] > kNear_m) continue;
    ++agreement.rays;
    if (std::abs(ours.scan.range_m[i] - naive.scan()[i]) < kAlike_m) ++agreement.alike;
  }
  return agreement;
}

}  // namespace omnifleet::bench
