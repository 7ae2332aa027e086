#pragma once

#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/floor_blocks.h"
#include "ground/floor_growth.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Where growth has gone over from the floor around the robot onto what is far grainier: a wall as light as
/// the floor is, which neither hue nor brightness tells, or another floor. One camera alone cannot say which,
/// so it is told. The grain of a block is what it differs by from the blocks on either side, along or across,
/// whichever is less: neither slopes of the light nor most lines and edges are grain.
class GrainyFloor {
 public:
  /// @param growth of blocks of block_cells × block_cells cells
  GrainyFloor(const lens::Camera& camera, const FloorView& view, const FloorGrowth& growth, int block_cells);

  /// @param growth, things of the same frame
  void find(const FloorGrowth& growth, const BitMask& things);
  void clear() { pool_.give(found_); }
  /// What was found last.
  const std::vector<Blob>& found() const { return found_; }

 private:
  static constexpr std::uint8_t kLow = 1, kHigh = 2;
  void readGreens(const FloorGrowth& growth, const BitMask& things);
  float seedsGrain(const FloorGrowth& growth);
  void mark(float coarse);
  bool isLarge(const Blob& region) const;
  void keep(const Blob& region);

  FloorBlocks floor_;
  std::vector<cv::Range> rows_;  ///< of blocks that may show floor
  std::vector<cv::Point> seeds_;
  cv::Mat1f greens_;    ///< per block, 0 where things are
  cv::Mat1b counts_;    ///< per block: is its grain known, and is it coarse
  cv::Mat1w sums_;      ///< of the counts around each block
  cv::Mat1b marks_;     ///< per block
  float level_ = 0.0f;  ///< of the seeds
  std::vector<float> sorted_;
  BlobPool pool_;
  std::vector<Blob> found_;
};

}  // namespace omnifleet::ground
