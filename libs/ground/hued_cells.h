#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Regions of cells whose hue differs slightly from the floor's. A single cell is no evidence, but a ring of
/// such cells is (LowWalls::findFaint). Noise breaks walls with a hue near the floor's into pieces in the
/// pixel mask, but not in this cell mask.
class HuedCells {
 public:
  explicit HuedCells(cv::Size image);

  /// Inputs per cell of the frame.
  struct Frame {
    const cv::Mat1b& off;      ///< with a margin of 1: 1 where the cell is not clearly floor
    const cv::Mat1f& across2;  ///< with a margin of 1: CellHues::across2
    const cv::Mat3f& colours;  ///< cell means
    const cv::Mat3f& floor;    ///< floor reference
    float tolerance_across;    ///< hue tolerance as a share of the floor's brightness
    float hue_noise;           ///< σ of a mean, grey levels
  };
  /// @param area area of the regions, whole cells
  /// @return valid until the next call
  const std::vector<Blob>& find(const Frame& frame, const BitArea& area);

 private:
  void mark(const Frame& frame);

  cv::Mat1b cells_;  ///< 1 where the cell has another hue
  BitMask pixels_;
  Labeller labeller_;
};

}  // namespace omnifleet::ground
