#pragma once

#include <opencv2/core/mat.hpp>
#include <optional>
#include <vector>

#include "geometry/pose2.h"
#include "lens/camera.h"
#include "markers/blobs.h"
#include "markers/layout.h"
#include "markers/patch_finder.h"

namespace omnifleet::markers {

/// A possible robot: its marker would show two of the blobs.
struct Hypothesis {
  std::size_t pattern = 0;
  Pose2 map_from_base;
  double error_px = 0.0;  ///< about how far the pose is wrong
  double vote = 0.0;      ///< share of the marker's points that have the right class in the image
};

/// Finds possible robots: two blobs with the classes, the distance and about the areas of two components of a
/// marker. Distances and areas are in metres on the plane of the markers. Few hypotheses per place remain: the
/// others disagree with the classes of the image.
class HypothesisFinder {
 public:
  HypothesisFinder(const lens::Camera& camera, double height_m, const Layout& layout, const ColourTable& table,
                   const FinderOptions& options);

  /// Best vote first.
  const std::vector<Hypothesis>& find(const cv::Mat& bgr, const std::vector<Blob>& blobs);

  /// Share of the marker's points inside the image that have the right class; 0 if less than a third is inside.
  double vote(const cv::Mat& bgr, const Pattern& pattern, const Pose2& map_from_base) const;

 private:
  /// A blob on the plane of the markers.
  struct Area {
    std::uint8_t colour = 0;
    Eigen::Vector2d centre_m{0.0, 0.0};
    double area_m2 = 0.0, metres_per_px = 0.0;
    bool cut = false;  ///< touches the image border, so only a part is visible
  };

  void toPlane(const std::vector<Blob>& blobs, cv::Size image);
  bool plausible(const Area& area, const Component& component) const;
  void pair(const cv::Mat& bgr, std::size_t pattern, const Component& a, const Component& b);
  void thinOut();

  const lens::Camera& camera_;
  double height_m_;
  const Layout& layout_;
  const ColourTable& table_;
  FinderOptions options_;
  std::vector<Area> areas_;
  std::vector<Hypothesis> all_, kept_;
};

}  // namespace omnifleet::markers
