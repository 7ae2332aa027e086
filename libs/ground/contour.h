#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "options/options.h"

namespace omnifleet::ground {

struct ContourOptions {
  bool refine = true;      ///< move each midpoint to where the brightness is halfway between floor and object
  double search_px = 2.0;  ///< pixels to each side that are searched, 0.5–4
  double min_contrast = 8.0;  ///< grey levels between floor and object below which a midpoint stays
  static ContourOptions read(const options::Section& section);
};

/// Outline of a region: the midpoints of the pixel edges between inside and outside (not the centres of
/// border pixels, which lie half a pixel inside), in closed loops, one per piece, holes left out.
struct Contour {
  std::vector<Eigen::Vector2f> points_px;
  std::vector<std::size_t> loop_begin;  ///< index of each loop's first point; the region on the right-hand
                                        ///< side when seen with v down, i.e. clockwise on the screen
};

/// Traces and refines outlines.
class ContourTracer {
 public:
  ContourTracer(const FloorView& view, const ContourOptions& options);

  /// @param image BGR8 or grey; objects: the mask the blob was labelled in; floor: floor colour per cell
  void trace(const cv::Mat& image, const cv::Mat1b& objects, const cv::Mat3f& floor, const Blob& blob,
             Contour& contour);

 private:
  void followLoop(const cv::Mat1b& objects, cv::Point start, Contour& contour);
  void refine(const cv::Mat& image, const cv::Mat3f& floor, std::size_t begin, std::size_t end,
              Contour& contour);

  const FloorView* view_;
  ContourOptions options_;
  cv::Mat1b visited_;
  std::vector<cv::Point> marked_;
  std::vector<Eigen::Vector2f> moved_;
};

}  // namespace omnifleet::ground
