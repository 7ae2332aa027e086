#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/floor_blocks.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "ground/region_growing.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Finds where region growing leaked from the floor around the robot onto a surface with far coarser texture.
/// Such a surface is a wall as bright as the floor and of its hue, or another floor. One camera alone cannot
/// distinguish the two, so the region is reported as a candidate. The texture of a block is the smaller of
/// its second differences along and across. Gradients of the illumination and most lines and edges have
/// little of it.
class CoarseTexture {
 public:
  /// @param growing has blocks of block_cells × block_cells cells
  CoarseTexture(const lens::Camera& camera, const FloorView& view, const RegionGrowing& growing,
                int block_cells);

  /// @param growing, objects of the same frame
  void find(const RegionGrowing& growing, const BitMask& objects);
  void clear() { pool_.give(found_); }
  /// Regions found by the last find().
  const std::vector<Blob>& found() const { return found_; }

 private:
  static constexpr std::uint8_t kLow = 1, kHigh = 2;
  void readGreens(const RegionGrowing& growing, const BitMask& objects);
  float seedTexture(const RegionGrowing& growing);
  void mark(float coarse);
  bool isLarge(const Blob& region) const;
  void keep(const Blob& region);

  FloorBlocks floor_;
  std::vector<cv::Range> rows_;  ///< range of blocks that may show floor
  std::vector<cv::Point> seeds_;
  cv::Mat1f greens_;    ///< mean green per block, 0 on objects
  cv::Mat1b counts_;    ///< per block: texture known, texture coarse
  cv::Mat1w sums_;      ///< sums of the counts around each block
  cv::Mat1b marks_;     ///< marks per block: kLow, kHigh
  float level_ = 0.0f;  ///< mean green of the seeds
  std::vector<float> sorted_;
  BlobPool pool_;
  std::vector<Blob> found_;
};

}  // namespace omnifleet::ground
