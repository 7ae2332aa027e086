#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "lens/camera.h"
#include "tests/benchmark/floor_remap.h"

namespace omnifleet::bench {

/// The local mapper as one would write it first, with OpenCV at every step: the whole frame is mapped back to
/// the floor plane (maps computed once), ground by back-projection of its histogram, connected components,
/// Harris corners over the whole frame, pyramidal Lucas–Kanade there and back (what does not return is
/// dropped, as in ours), a hull for every region. It finds the objects that ours finds (fairness.h counts),
/// though less exactly: no sub-pixel outline, no supports, no scan, no filter of the vectors by label.
class NaiveMapper {
 public:
  explicit NaiveMapper(const lens::Camera& camera) : remap_(camera) {}

  struct Region {
    int label = 0;
    int area_px = 0;
    std::vector<cv::Point> hull;                ///< pixels of the plan
    std::vector<Eigen::Vector2d> from_m, to_m;  ///< its corners in the frame before and now, base_link
  };
  const std::vector<Region>& process(const cv::Mat3b& bgr);

  const FloorRemap& remap() const { return remap_; }
  const cv::Mat3b& plan() const { return plan_; }
  /// Labels of the regions on the plan; 0: floor.
  const cv::Mat1i& labels() const { return labels_; }

 private:
  void removeGround();
  void follow();
  void makeRegions();
  void sortCorners(const std::vector<int>& region_of);

  FloorRemap remap_;
  cv::Mat3b plan_, hsv_;
  cv::Mat1b ground_, objects_, grey_, previous_grey_;
  cv::Mat histogram_, statistics_, centroids_;
  cv::Mat1i labels_;
  std::vector<cv::Point2f> corners_, previous_corners_, returned_;
  std::vector<unsigned char> followed_, returned_well_;
  std::vector<float> error_;
  std::vector<Region> regions_;
};

}  // namespace omnifleet::bench
