#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_growth.h"
#include "ground/floor_view.h"

namespace omnifleet::ground {

/// Floor colour of every cell from the blocks that growth has reached: their normalised convolution, 2×2 of
/// them at a time, then the same of what it left over; where hardly any floor is near, from farther off.
class FloorSmoothing {
 public:
  /// @param growth whose blocks have `per_block` cells of the view to each side
  /// @param window_cells side of the window that smooths
  FloorSmoothing(const FloorGrowth& growth, const FloorView& view, int per_block, int window_cells);

  /// @return CV_32FC3 per cell of the view and around it, elsewhere 0; valid until the next call
  const cv::Mat3f& smooth(const FloorGrowth& growth);
  const cv::Mat3f& colour() const { return colour_; }
  /// Of colours in even light: those in this one, by which they are multiplied, per cell.
  void shine(const cv::Mat1f& light);

 private:
  /// Where the middle of a cell lies between the middles of coarser pixels.
  struct Between {
    int first, second;
    float share;  ///< of the second
  };
  static Between between(int cell, int scale, int coarse_size);
  void sumBlocks(const FloorGrowth& growth);
  void blurTwice();
  void fillAndDivide();
  void spread();
  static void mixColumns(const float* row, const Between* between, int n, float* out);

  int scale_;                    ///< cells per side of a pixel of sums_
  int radius_;                   ///< of the window, in those pixels
  std::vector<int> sum_of_;      ///< of each block's number: where in sums_ it counts
  cv::Mat4f sums_, fine_;        ///< colour and weight, 2×2 blocks a pixel; means of what was taken so far
  cv::Mat4f residual_, filler_;  ///< means of what is left
  cv::Mat1f framed_, summed_;    ///< four floats a pixel; with a margin of zeros
  std::vector<cv::Mat> pyramid_;
  std::vector<Between> columns_, rows_;  ///< of colour_ in fine_
  std::vector<cv::Range> asked_;         ///< columns of each row of colour_
  std::vector<cv::Range> asked_wide_;    ///< likewise of wide_
  cv::Mat3f wide_;                       ///< rows as of fine_, columns as of colour_
  cv::Mat3f colour_;
};

}  // namespace omnifleet::ground
