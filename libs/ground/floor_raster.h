#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// The floor around the robot, seen from above: contrast against the surroundings, on a square grid whose
/// axes are those of base_link (column: x, row: y). Each cell averages the pixels that it
/// covers, by a table computed once from the lens. The raster is (narrow − wide) ÷ wide, with Gaussian means
/// of σ 1 and σ 4 cells: it does not depend on brightness, gain or vignetting. Cells that are no floor take
/// no part in either mean.
///
/// What is fixed in the image (dirt, the robot's own shadow, blocks of a compressed image) also appears in
/// the raster. learnFixed() keeps the mean of earlier rasters. Where this mean is larger than chance
/// explains, make() subtracts it.
class FloorRaster {
 public:
  /// Value of a cell that shows no floor, or has too little floor around it.
  static constexpr std::int16_t kNone = -32768;
  static constexpr float kOne = 8192.0f;  ///< value of a contrast of 1
  static constexpr int kBlock = 16;       ///< cells; the side is a multiple of it

  /// @param inner_m, outer_m limits of the annulus around the foot of the camera
  FloorRaster(const lens::Camera& camera, const FloorView& view, double inner_m, double outer_m,
              double cell_m);

  /// @param image CV_8UC1, or CV_8UC3 (BGR; the green channel is used), of the view's size
  /// @param objects not 0 where a pixel is not floor; empty: floor everywhere
  void make(const cv::Mat& image, const cv::Mat1b& objects);
  /// Adds the last raster to the mean of what is fixed in the image. Call it only after the robot has moved
  /// farther than the texture correlates (5 cm).
  void learnFixed();
  /// Contrast of the last raster in cells of kCoarse: (narrow − wide) ÷ wide, with means over the cell and of
  /// σ 4 fine cells; 0 where there is no floor.
  void makeCoarse(cv::Mat1f& coarse) const;
  static constexpr int kCoarse = 4;        ///< fine cells per coarse cell
  static constexpr int kCoarseBorder = 8;  ///< coarse cells of value 0 around the raster

  int side() const { return side_; }
  int cells() const { return cells_; }          ///< with a value, in the last raster
  float contrast() const { return contrast_; }  ///< mean magnitude of the values of the last raster, robust
  const cv::Mat1s& values() const { return values_; }
  /// Per cell its value (low half) and that of the next row (high half), for bilinear sampling.
  const cv::Mat1i& pairs() const { return pairs_; }
  /// Position of base_link in the raster: column, row.
  const Eigen::Vector2d& base() const { return base_; }

 private:
  void addCells(const lens::Camera& camera, const FloorView& view, double inner_m, double outer_m,
                double cell_m);
  struct Cell;
  void chooseTaps(const std::vector<Cell>& cells);
  void findOffsets(const cv::Mat& image, const cv::Mat1b& objects);
  void sample(const cv::Mat& image);
  void markObjects(const cv::Mat1b& objects);
  void findWide();
  void findNarrow();
  void finish();

  int side_ = 0, half_ = 0;
  Eigen::Vector2d base_ = Eigen::Vector2d::Zero();
  cv::Size image_size_;
  std::vector<std::int32_t> index_;  ///< cells that can show floor
  std::vector<cv::Point2f> pixels_;  ///< of each of them
  int taps_ = 1;                     ///< positions in the image per cell, of which the mean is taken
  std::vector<cv::Point2f> tap_pixels_;
  std::vector<std::uint16_t> tap_shares_;  ///< 1/128 px beyond the upper left pixel: column, row · 256
  std::vector<std::int32_t> tap_offsets_, object_offsets_;
  std::size_t image_step_ = 0, object_step_ = 0;
  int channels_ = 0;

  cv::Mat1b inside_, inner_;     ///< cells that can show floor; those with kMargin such cells around them
  cv::Mat1b floor_, used_;       ///< likewise in this frame
  cv::Mat1b blocked_, dilated_;  ///< buffers
  cv::Mat1w grey_;               ///< 64 · brightness; 0 where floor_ is 0
  cv::Mat1f sums_, counts_;      ///< of 2 × 2 cells
  cv::Mat1f scale_;              ///< 1 ÷ wide, likewise
  cv::Mat1f buffer_, other_buffer_;
  std::vector<float> rows_;  ///< the last five rows, smoothed along the row
  std::vector<std::uint32_t> stage_;
  std::vector<std::uint16_t> brightness_;
  cv::Mat1s raw_;    ///< before the fixed part is subtracted
  cv::Mat1s fixed_;  ///< part of mean_ beyond chance
  cv::Mat1f mean_, weights_;
  bool has_fixed_ = false;
  cv::Mat1s values_;
  cv::Mat1i pairs_;
  int cells_ = 0;
  float contrast_ = 0.0f;
};

}  // namespace omnifleet::ground
