#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/edge_refiner.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Outline of a region in closed loops, one per connected piece, without holes. The points are the midpoints
/// of the pixel edges between inside and outside. The centres of border pixels would lie half a pixel inside.
struct Contour {
  std::vector<Eigen::Vector2f> points_px;
  std::vector<std::size_t> loop_begin;  ///< index of each loop's first point; loops run clockwise (v down)
  std::vector<std::uint8_t> beside;     ///< per point: mask value on the other side, 0 for floor
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
