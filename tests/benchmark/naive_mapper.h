#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "geometry/pose2.h"
#include "lens/camera.h"
#include "tests/benchmark/floor_remap.h"

namespace omnifleet::bench {

/// The local mapper as one would write it first, with OpenCV at every step: the whole frame is mapped back to
/// the floor plane (maps computed once), ground by back-projection of its histogram, connected components,
/// Harris responses over the whole frame, of which corners are taken where there are objects, pyramidal
/// Lucas–Kanade there and back (what does not return is dropped, as in ours), own motion taken out and
/// vectors filtered per region by direction and length, a hull for every region, and a scan: the objects'
/// mask along 360 bearings. It finds the objects that ours finds (fairness.h counts), though less exactly: no
/// sub-pixel outline, no supports, no points in space. Its plan reaches as far as our scan does, to all
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
    std::vector<Eigen::Vector2d> from_m, to_m;  ///< its corners in the frame before and now, base_link
  };
  /// @param previous_from_current how the robot moved, by its wheels
  const std::vector<Region>& process(const cv::Mat3b& bgr, const Pose2& previous_from_current);
  /// Distance from the camera's foot to the first object along bearing 2πi/kRays, metres; 2.5 where
  /// there is none.
  const std::vector<double>& scan() const { return scan_m_; }

  const FloorRemap& remap() const { return remap_; }
  const cv::Mat3b& plan() const { return plan_; }
  /// Labels of the regions on the plan; 0: floor.
  const cv::Mat1i& labels() const { return labels_; }

 private:
  void removeGround();
  void follow();
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
  std::vector<unsigned char> followed_, returned_well_;
  std::vector<float> error_;
  std::vector<Region> regions_;
  cv::Mat polar_map_, polar_fraction_;  ///< places on the plan along the bearings
  cv::Mat1b polar_;
  std::vector<double> scan_m_;
};

}  // namespace omnifleet::bench
