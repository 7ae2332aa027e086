#pragma once

#include <array>
#include <cstdint>
#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/floor_view.h"
#include "ground/labelling.h"
#include "ground/strip.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// The blocks of a view as an image with one pixel per block: their positions on the floor, and connected
/// regions of marked blocks.
class FloorBlocks {
 public:
  static constexpr int kSectors = 144;  ///< per turn

  /// @param size size of the view in blocks of block_cells × block_cells cells
  FloorBlocks(const lens::Camera& camera, const FloorView& view, cv::Size size, int block_cells);

  cv::Size size() const { return floor_m_.size(); }
  int sizePx() const { return block_px_; }
  /// Distance from the camera's foot in metres; 0 where part of the block cannot show floor.
  const cv::Mat1f& floorM() const { return floor_m_; }
  /// Sector of each block by its direction in the image from the camera's foot; also 0 where there is none.
  const cv::Mat1b& sectors() const { return sectors_; }
  /// Returns a mask for marks: at least as large as size(), all 0.
  cv::Mat1b marks() const { return cv::Mat1b(marked_px_, std::uint8_t{0}); }

  /// @param marks created by marks()
  /// @return regions of the blocks that are not 0; valid until the next call
  const std::vector<Blob>& regions(const cv::Mat1b& marks);

  /// Distance of the farthest marked block of a region per sector, metres; 0: none.
  using Lengths = std::array<float, kSectors>;
  Lengths lengthsOf(const Blob& region, const cv::Mat1b& marks, std::uint8_t mark) const;
  /// Length along the arc around the camera, metres.
  static double lengthOf(const Lengths& farthest_m);

 private:
  int block_px_;
  cv::Mat1f floor_m_;
  cv::Mat1b sectors_;
  cv::Size marked_px_;      ///< size in whole rows of strips
  std::vector<Strip> all_;  ///< all strips; here a pixel is a block
  BitMask bits_;
  BitArea area_;
  Labeller labeller_;
};

}  // namespace omnifleet::ground
