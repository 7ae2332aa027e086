#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "lens/camera.h"

namespace omnifleet::ground {

/// How the floor's light goes on outward, block by block. Light falls over the floor, not over the picture:
/// far off each block shows a longer piece of floor than the one before, so that a slope of brightness that
/// is even over the floor, or that of a lamp overhead, grows steeper from block to block.
class FarFloor {
 public:
  /// Steps to the eight neighbours of a block, in the order of the bits.
  static constexpr int kSteps = 8;
  static constexpr int kStepX[kSteps] = {1, 0, -1, 0, 1, -1, -1, 1},
                       kStepY[kSteps] = {0, 1, 0, -1, 1, 1, -1, -1};

  /// @param blocks how many, of block_px × block_px pixels each, from the image's corner
  FarFloor(const lens::Camera& camera, cv::Size blocks, int block_px);

  struct Block {
    std::uint8_t outward = 0;  ///< bit k: step k leads away from the camera's foot
    float steepening = 1.0f;   ///< of a slope in such a step, at least 1
  };
  const Block& operator[](int block) const { return blocks_[static_cast<std::size_t>(block)]; }

 private:
  std::vector<Block> blocks_;
};

}  // namespace omnifleet::ground
