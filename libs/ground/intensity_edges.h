#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/floor_blocks.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "ground/region_growing.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Long intensity edges of the floor that region growing has crossed or bypassed. Behind a marking, a joint
/// or a thin shadow the floor continues as before. Where the brightness changes abruptly on the way outward,
/// by more than the light on either side explains, there is either the foot of a low wall of nearly the
/// floor's colour or the border of another floor. One camera alone cannot distinguish the two.
class IntensityEdges {
 public:
  /// @param growing of blocks of block_cells × block_cells cells
  IntensityEdges(const lens::Camera& camera, const FloorView& view, const RegionGrowing& growing,
                 int block_cells);

  /// @param tolerance share of the brightness by which floor may differ from the expected value
  void find(const RegionGrowing& growing, float tolerance);
  void clear() { pool_.give(found_); }
  /// Regions (pixels) of the edges found by the last find().
  const std::vector<Blob>& found() const { return found_; }

 private:
  static constexpr int kSectors = FloorBlocks::kSectors;
  static constexpr std::uint8_t kLow = 1, kHigh = 2;
  static constexpr int kSlope = 3;    ///< blocks over which the gradient of the light is measured
  static constexpr int kMostGap = 3;  ///< blocks that region growing may leave out along an edge
  static constexpr int kReach = 2 + kMostGap + kSlope - 1;
  /// Offsets of 1 to kReach blocks away from the camera foot, in the block numbers of RegionGrowing.
  using Outward = std::array<int, kReach + 1>;
  struct Block {
    int at;  ///< block number of RegionGrowing
    std::uint8_t sector;
    float floor_m;  ///< metres from the camera foot
  };
  using Lengths = FloorBlocks::Lengths;
  /// Edges of one sign, seen on the way outward.
  struct Side {
    cv::Mat1b marks;  ///< per block: kLow or kHigh where an edge is
    Lengths high_m;   ///< per sector: distance of the farthest kHigh block, metres; 0: none
  };
  float levelOf(int number) const { return levels_[static_cast<std::size_t>(number)]; }
  float stepAt(int at, const Outward& outward, int behind) const;
  void mark(const RegionGrowing& growing, float tolerance);
  static bool isLong(const Lengths& high_m);
  void keep(const Blob& region);

  FloorBlocks floor_;
  std::array<Outward, kSectors> outward_{};
  std::vector<float>
      levels_;  ///< brightness of the floor by block number; 0 where region growing did not arrive
  std::vector<Block> blocks_;  ///< blocks that may show floor
  Side darker_, lighter_;
  BlobPool pool_;
  std::vector<Blob> found_;
};

}  // namespace omnifleet::ground
