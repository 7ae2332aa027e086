#pragma once

#include <array>
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
  double vote = 0.0;      ///< mean similarity of the image's colours at the marker's points
};

/// Finds possible robots: two blobs with the classes, the distance and about the areas of two components of a
/// marker. Distances and areas are in metres on the plane of the markers. Few hypotheses per place remain:
/// the others disagree with the classes of the image.
class HypothesisFinder {
 public:
  HypothesisFinder(const lens::Camera& camera, double height_m, const Layout& layout,
                   const ColourTable& table, const FinderOptions& options);

  /// Hypotheses from pairs of blobs, best vote first.
  const std::vector<Hypothesis>& find(const cv::Mat& bgr, const std::vector<Blob>& blobs);

  /// Hypotheses for one object that has about the area of a marker, all headings and robots. For markers so
  /// small or blurred that their regions show mixed colours and form no blobs. Best vote first.
  const std::vector<Hypothesis>& findInObject(const cv::Mat& bgr, const Blob& object);
  /// Position of an object on the plane of the markers, map.
  std::optional<Eigen::Vector2d> placeOf(const Blob& object) const;

  /// Mean similarity of the colours at the marker's points inside the image; 0 if less than a third is
  /// inside.
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
  bool localScale(const Eigen::Vector2d& centre_m, Eigen::Vector2d& pixel, Eigen::Matrix2d& px_per_m) const;
  double voteAt(const cv::Mat& bgr, const Pattern& pattern, const Eigen::Vector2d& middle_px,
                const Eigen::Matrix2d& px_per_m) const;

  const lens::Camera& camera_;
  double height_m_;
  const Layout& layout_;
  const ColourTable& table_;
  FinderOptions options_;
  std::vector<Area> areas_;
  mutable std::vector<std::array<float, 2>> sums_;  ///< per class: similarity and number of points
  std::vector<Hypothesis> all_, kept_;
};

}  // namespace omnifleet::markers
