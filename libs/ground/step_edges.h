#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_blocks.h"
#include "ground/floor_growth.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Long steps of the floor's brightness that growth has gone over or around. Behind a marking, a joint or a
/// thin shadow floor goes on as it was before. Where on the way outward it is darker or lighter at once than
/// the light on either side explains, there is the foot of a low wall of nearly the floor's colour, or
/// another floor: one camera alone cannot tell them.
class StepEdges {
 public:
  /// @param growth of blocks of block_cells × block_cells cells
  StepEdges(const lens::Camera& camera, const FloorView& view, const FloorGrowth& growth, int block_cells);

  /// @param tolerance share of the brightness by which floor may differ from what is expected
  void find(const FloorGrowth& growth, float tolerance);
  void clear() { pool_.give(found_); }
  /// The blocks of the steps that were found last.
  const std::vector<Blob>& found() const { return found_; }

 private:
  static constexpr int kSectors = FloorBlocks::kSectors;
  static constexpr std::uint8_t kLow = 1, kHigh = 2;
  static constexpr int kSlope = 3;    ///< blocks, over which the light's slope is measured
  static constexpr int kMostGap = 3;  ///< blocks that growth leaves out along an edge
  static constexpr int kReach = 2 + kMostGap + kSlope - 1;
  /// Steps of 1 to kReach blocks away from the camera's foot, in growth's numbers.
  using Outward = std::array<int, kReach + 1>;
  struct Block {
    int at;  ///< growth's number
    std::uint8_t sector;
    float floor_m;  ///< from the camera's foot
  };
  using Lengths = FloorBlocks::Lengths;
  /// Steps one way, seen on the way outward.
  struct Side {
    cv::Mat1b marks;  ///< per block: kLow, kHigh where a step is
    Lengths high_m;   ///< the farthest high one by sectors; 0: none
  };
  float levelOf(int number) const { return levels_[static_cast<std::size_t>(number)]; }
  float stepAt(int at, const Outward& outward, int behind) const;
  void mark(const FloorGrowth& growth, float tolerance);
  static bool isLong(const Lengths& high_m);
  void keep(const Blob& region);

  FloorBlocks floor_;
  std::array<Outward, kSectors> outward_{};
  std::vector<float> levels_;  ///< brightness of floor, by growth's numbers; 0 where growth has not been
  std::vector<Block> blocks_;  ///< that may show floor
  Side darker_, lighter_;
  BlobPool pool_;
  std::vector<Blob> found_;
};

}  // namespace omnifleet::ground
