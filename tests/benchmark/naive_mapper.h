#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "lens/camera.h"
#include "tests/benchmark/floor_remap.h"

namespace omnifleet::bench {

/// The naive peer of the local mapper: OpenCV at every step.
/// - The whole frame is remapped to the floor plane (maps computed once).
/// - Ground by back-projection of a histogram, then connected components.
/// - Harris corners on the object mask; the responses are computed over the whole plan.
/// - Pyramidal Lucas–Kanade forward and backward. What does not return is dropped, as in the local mapper.
/// - The robot's own motion is removed. Vectors are filtered per region by direction and length.
/// - A convex hull per region, and a scan: the object mask along 360 bearings.
/// It finds the same objects as the local mapper (fairness.h counts them), but less accurately: no sub-pixel
/// outlines, support values or points in space. Its plan has the range of the local mapper's scan on all
/// sides.
class NaiveMapper {
 public:
  static constexpr int kRays = 360;

  explicit NaiveMapper(const lens::Camera& camera);

  struct Region {
    int label = 0;
    int area_px = 0;
    std::vector<cv::Point> hull;                ///< pixels of the plan
    std::vector<Eigen::Vector2d> hull_m;        ///< base_link
    std::vector<Eigen::Vector2d> from_m, to_m;  ///< corners in the previous and this frame, base_link
  };
  /// @param previous_from_current motion of the robot from its wheels
  const std::vector<Region>& process(const cv::Mat3b& bgr, const Pose2& previous_from_current);
  /// Distance (metres) from the camera's foot to the first object along bearing 2πi/kRays; 2.5 without
  /// object.
  const std::vector<double>& scan() const { return scan_m_; }

  const FloorRemap& remap() const { return remap_; }
  const cv::Mat3b& plan() const { return plan_; }
  /// Region labels on the plan; 0: floor.
  const cv::Mat1i& labels() const { return labels_; }

 private:
  void removeGround();
  void trackCorners();
  void makeRegions();
  void sortCorners(const std::vector<int>& region_of);
  static void filter(const Pose2& previous_from_current, Region& region);
  void makeScan();

  FloorRemap remap_;
  cv::Mat3b plan_, hsv_;
  cv::Mat1b ground_, objects_, grey_, previous_grey_;
  cv::Mat histogram_, statistics_, centroids_;
  cv::Mat1i labels_;
  std::vector<cv::Point2f> corners_, previous_corners_, returned_;
  std::vector<unsigned char> tracked_, returned_status_;
  std::vector<float> error_;
  std::vector<Region> regions_;
  cv::Mat polar_map_, polar_fraction_;  ///< plan coordinates along the bearings
  cv::Mat1b polar_;
  std::vector<double> scan_m_;
};

}  // namespace omnifleet::bench
