#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/edge_search.h"
#include "ground/floor_view.h"
#include "options/options.h"

namespace omnifleet::ground {

struct ContourOptions {
  bool refine = true;      ///< move each midpoint to where the brightness is halfway between floor and object
  double search_px = 2.0;  ///< pixels, search range on each side, 0.5–4
  double min_contrast = 8.0;  ///< grey levels, minimum contrast for moving a midpoint
  bool smooth = true;         ///< smooth the outline with a parabola over seven points
  bool sharpen = true;        ///< restore corners that pixels and smoothing round off
  static ContourOptions read(const options::Section& section);
};

/// Read-only inputs of a frame for tracing and refining outlines.
struct ContourFrame {
  const cv::Mat& image;      ///< BGR8 or grey
  const cv::Mat1b& grey;     ///< brightness of the image (BT.601)
  const cv::Mat1b& objects;  ///< mask in which the regions were labelled
  const cv::Mat3f& floor;    ///< floor colour per cell
  float hue_noise;           ///< FloorNoise::hue of the image
};

/// Sub-pixel refinement of an outline, which starts from the midpoints between the region's pixels and the
/// floor's pixels. At high contrast the mask alone is up to half a pixel too large: one tenth of object in a
/// pixel makes it "not floor".
class EdgeRefiner {
 public:
  EdgeRefiner(const FloorView& view, const ContourOptions& options) : view_(&view), options_(options) {}

  /// Moves the n points of one closed loop. The region is on the right-hand side in walking direction (v
  /// down). Removes some points of the straight parts of a large outline.
  /// @param beside per point: not 0 where another object is on the other side instead of floor
  /// @return number of remaining points; `beside` is compacted in the same way
  std::size_t refine(const ContourFrame& frame, Eigen::Vector2f* points, std::uint8_t* beside, std::size_t n);

 private:
  void findSkipped(const Eigen::Vector2f* points, std::size_t n);
  void fillSkipped();
  void findEdges(const ContourFrame& frame, const Eigen::Vector2f* points, const std::uint8_t* beside,
                 std::size_t n);
  void prefetch(const ContourFrame& frame, const Eigen::Vector2f& p) const;
  void put(const cv::Mat3f& floor, const Eigen::Vector2f& p, const Eigen::Vector2f& along,
           std::uint8_t beside, int lane);
  int takeEdges(const ContourFrame& frame, const std::size_t* which, int count);
  void smooth();
  void sharpen(Eigen::Vector2f* points) const;

  const FloorView* view_;
  ContourOptions options_;
  std::vector<Eigen::Vector2f> found_, smoothed_;
  std::vector<std::uint8_t> is_found_, is_skipped_;
  EightEdges edges_{};
};

}  // namespace omnifleet::ground
