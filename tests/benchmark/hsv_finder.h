#pragma once

#include <Eigen/Core>
#include <map>
#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "dataset/markers.h"
#include "lens/camera.h"

namespace omnifleet::bench {

/// The naive peer of the patch finder: converts the image to HSV, extracts each colour by inRange and
/// connected components, and pairs team and individual patches that are at the right distance.
class HsvFinder {
 public:
  HsvFinder(const lens::Camera& camera, const dataset::MarkerSet& markers);
  /// Position of base_link in map (metres) for each robot that was found.
  const std::map<std::string, Eigen::Vector2d>& find(const cv::Mat3b& bgr);

 private:
  struct Colour {
    std::string robot;  ///< owner of the individual patch
    int hue;
  };
  void patchesOf(int hue, std::vector<Eigen::Vector2d>& centres_m);

  lens::Camera camera_;
  dataset::MarkerSet markers_;
  std::vector<Colour> colours_;
  cv::Mat3b hsv_;
  cv::Mat1b mask_, wrapped_;
  cv::Mat labels_, statistics_, centroids_;
  std::vector<Eigen::Vector2d> team_, individual_;
  std::map<std::string, Eigen::Vector2d> found_;
};

}  // namespace omnifleet::bench
