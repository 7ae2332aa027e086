#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_view.h"
#include "ground/region_growing.h"

namespace omnifleet::ground {

/// Floor colour of every cell from the blocks that region growing reached. It applies a normalised
/// convolution to 2×2 blocks at a time, then again to the residuals. Where hardly any floor is near, it uses
/// floor farther away.
class FloorSmoothing {
 public:
  /// @param growing its blocks have `per_block` cells of the view per side
  /// @param window_cells side of the smoothing window
  FloorSmoothing(const RegionGrowing& growing, const FloorView& view, int per_block, int window_cells);

  /// @return CV_32FC3 per cell of the view and its surroundings, 0 elsewhere; valid until the next call
  const cv::Mat3f& smooth(const RegionGrowing& growing);
  const cv::Mat3f& colour() const { return colour_; }
  /// Multiplies the colours, which are those in even light, by the actual light per cell.
  void applyLight(const cv::Mat1f& light);

 private:
  /// Interpolation of a cell's centre between two coarser pixels.
  struct Between {
    int first, second;
    float share;  ///< weight of the second pixel
  };
  static Between between(int cell, int scale, int coarse_size);
  void sumBlocks(const RegionGrowing& growing);
  void blurTwice();
  void fillAndDivide();
  void spread();
  static void mixColumns(const float* row, const Between* between, int n, float* out);

  int scale_;                    ///< cells per side of a pixel of sums_
  int radius_;                   ///< of the window, in pixels of sums_
  std::vector<int> sum_of_;      ///< per block number: index of its pixel in sums_
  cv::Mat4f sums_, fine_;        ///< colour and weight, 2×2 blocks per pixel; fine_: means so far
  cv::Mat4f residual_, filler_;  ///< means of the residuals
  cv::Mat1f padded_, summed_;    ///< four floats per pixel, with a margin of zeros
  std::vector<cv::Mat> pyramid_;
  std::vector<Between> columns_, rows_;       ///< interpolation of colour_ in fine_
  std::vector<cv::Range> used_columns_;       ///< used columns of each row of colour_
  std::vector<cv::Range> used_wide_columns_;  ///< used columns of each row of wide_
  cv::Mat3f wide_;                            ///< rows of fine_, columns of colour_
  cv::Mat3f colour_;
};

}  // namespace omnifleet::ground
