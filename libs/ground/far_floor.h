#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::ground {

/// Predicts how the floor's brightness gradient changes outward, block by block. Illumination varies over the
/// floor, not over the image. Far away each block shows a longer piece of floor than the previous one. A
/// gradient that is constant over the floor, or that of a lamp overhead, therefore gets steeper from block to
/// block.
class FarFloor {
 public:
  /// Steps to the eight neighbours of a block, in the order of the bits of Block::outward.
  static constexpr int kSteps = 8;
  static constexpr int kStepX[kSteps] = {1, 0, -1, 0, 1, -1, -1, 1},
                       kStepY[kSteps] = {0, 1, 0, -1, 1, 1, -1, -1};

  /// @param blocks number of blocks of block_px × block_px pixels, from the image's corner
  FarFloor(const lens::Camera& camera, cv::Size blocks, int block_px);

  struct Block {
    std::uint8_t outward = 0;  ///< bit k: step k leads away from the camera's foot
    float steepening = 1.0f;   ///< factor of a gradient in such a step, at least 1
  };
  const Block& operator[](int block) const { return blocks_[static_cast<std::size_t>(block)]; }

 private:
  std::vector<Block> blocks_;
};

}  // namespace omnifleet::ground
