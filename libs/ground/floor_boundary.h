#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <optional>

#include "ground/bearing_paths.h"
#include "ground/floor_view.h"
#include "lens/camera.h"
#include "observation/boundary.h"
#include "options/options.h"

namespace omnifleet::ground {

struct BoundaryOptions {
  int bearings = 720;           ///< over the full turn
  double max_angle_deg = 88.5;  ///< degrees from straight down; beyond, one pixel is metres of floor
  double run_px = 2.0;          ///< pixels in a row that are no floor: specks do not end it
  double min_contrast = 10.0;   ///< grey levels between the floor and what ends it
  double wall_contrast =
      4.0;  ///< likewise, near the foot of a known wall: 3 σ of the mean of five noisy pixels
  double wall_sigma_px =
      0.8;  ///< pixels: σ of such an edge at least (shadows at the foot; three rendered walls: 0.7–1)
  double max_shift_px = 4.0;  ///< pixels between the segmentation's edge and the refined one
  double sigma_px = 0.25;     ///< pixels: σ of an edge along its bearing, before it is scaled per frame
  static BoundaryOptions read(const options::Section& section);
};

/// Where the floor ends in each direction, as an inverse range with sub-pixel accuracy. The segmentation
/// gives the first pixel that is no floor; the edge is then located in the image along the bearing:
/// brightness is projected onto the difference between the colours on both sides, the floor's own gradient
/// (light that falls off) is extrapolated to the edge, and the area under the profile within ±2.5 px places
/// the edge. All of it is per bearing; nothing assumes
/// objects or closed outlines.
class FloorBoundary {
 public:
  /// Throws options::Error if no bearing shows floor.
  FloorBoundary(const lens::Camera& camera, const FloorView& view, const BoundaryOptions& options);

  /// @param image BGR8 or grey @param objects full resolution, 0 on floor
  /// @return valid until the next call
  Boundary& find(const cv::Mat& image, const cv::Mat1b& objects);

  /// Adds edges near places that are known otherwise, for beams without one: of walls of nearly the floor's
  /// colour. Such edges are faint, and some lie on shadows or in the pattern of the wall. So their σ is at
  /// least the scatter of their neighbours about straight lines (second differences), and lone ones are left
  /// out.
  /// @param expected_m by bearing: 1/m of the floor near which an edge is searched for; 0: none
  void complete(const cv::Mat& image, const std::vector<float>& expected_m, Boundary& boundary);

  struct Edge {
    float inverse_m = 0.0f, sigma = 0.0f;  ///< 1/m, of the floor there, and its σ
  };
  /// The edge nearest to a step of a bearing; none where the contrast is too low or the edge is not near it.
  std::optional<Edge> refine(std::size_t bearing, int step, const cv::Mat& image) const {
    return refine(bearing, step, image, options_.min_contrast);
  }

  const BearingPaths& paths() const { return paths_; }

 private:
  std::optional<Edge> refine(std::size_t bearing, int step, const cv::Mat& image, double min_contrast) const;
  int firstEnd(const BearingPaths::Path& path, const cv::Mat1b& objects) const;

  BoundaryOptions options_;
  BearingPaths paths_;
  Boundary boundary_;
  std::vector<std::uint8_t> added_;  ///< by bearing: by complete()
  std::vector<float> scatter_;       ///< of the neighbours of one beam
};

}  // namespace omnifleet::ground
