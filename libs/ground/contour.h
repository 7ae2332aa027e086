#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/edge_refiner.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Outline of a region: the midpoints of the pixel edges between inside and outside (not the centres of
/// border pixels, which lie half a pixel inside), in closed loops, one per piece, holes left out.
struct Contour {
  std::vector<Eigen::Vector2f> points_px;
  std::vector<std::size_t> loop_begin;  ///< index of each loop's first point; the region on the right-hand
                                        ///< side when seen with v down, i.e. clockwise on the screen
  std::vector<std::uint8_t> beside;  ///< per point: the mask's value on the other side, 0 where that is floor
};

/// Traces and refines outlines.
class ContourTracer {
 public:
  ContourTracer(const FloorView& view, const ContourOptions& options);

  void trace(const ContourFrame& frame, const Blob& blob, Contour& contour);

 private:
  void followLoop(const cv::Mat1b& objects, cv::Point start, Contour& contour);
  void refine(const ContourFrame& frame, Contour& contour);

  EdgeRefiner refiner_;
  cv::Mat1b visited_;
  std::vector<cv::Point> marked_;
};

}  // namespace omnifleet::ground
