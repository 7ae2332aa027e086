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
  double search_px = 2.0;  ///< pixels to each side that are searched, 0.5–4
  double min_contrast = 8.0;  ///< grey levels between floor and object below which a midpoint stays
  bool smooth = true;         ///< take the noise along the outline off, by a parabola over seven points
  bool sharpen = true;        ///< give corners back what the pixels and the smoothing round off
  static ContourOptions read(const options::Section& section);
};

/// What a frame offers for tracing and refining outlines; only read.
struct ContourFrame {
  const cv::Mat& image;      ///< BGR8 or grey
  const cv::Mat1b& grey;     ///< its brightness (BT.601)
  const cv::Mat1b& objects;  ///< the mask in which the regions were labelled
  const cv::Mat3f& floor;    ///< floor colour per cell
  float hue_noise;           ///< FloorNoise::hue of the image
};

/// Sub-pixel outline from the chain of midpoints between a region's pixels and the floor's. The mask alone is
/// up to half a pixel too large where the contrast is high, as one covered tenth of a pixel makes it "not
/// floor".
class EdgeRefiner {
 public:
  EdgeRefiner(const FloorView& view, const ContourOptions& options) : view_(&view), options_(options) {}

  /// Moves the n points of one closed loop, the region on the right-hand side when walked (v down), and
  /// leaves out some of the straight parts of a large one.
  /// @param beside per point, not 0 where another thing, no floor, lies on the other side
  /// @return how many points are left, with what is beside them
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
