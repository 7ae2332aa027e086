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

/// The blocks of a view as a picture of its own, one pixel each: where they lie on the floor, and regions of
/// those that are marked.
class FloorBlocks {
 public:
  static constexpr int kSectors = 144;  ///< of a turn

  /// @param size of the view in blocks of block_cells × block_cells cells
  FloorBlocks(const lens::Camera& camera, const FloorView& view, cv::Size size, int block_cells);

  cv::Size size() const { return floor_m_.size(); }
  int sizePx() const { return block_px_; }
  /// Metres from the camera's foot; 0 where not all of a block may show floor.
  const cv::Mat1f& floorM() const { return floor_m_; }
  /// By the direction in the picture, from the camera's foot; 0 too where there is none.
  const cv::Mat1b& sectors() const { return sectors_; }
  /// To be marked: at least as large as size(), 0.
  cv::Mat1b marks() const { return cv::Mat1b(marked_px_, std::uint8_t{0}); }

  /// @param marks as marks() made them @return of those that are not 0; valid until the next call
  const std::vector<Blob>& regions(const cv::Mat1b& marks);

  /// By sectors: the farthest block of some, metres; 0: none.
  using Lengths = std::array<float, kSectors>;
  Lengths lengthsOf(const Blob& region, const cv::Mat1b& marks, std::uint8_t mark) const;
  /// Along what the camera sees, metres.
  static double lengthOf(const Lengths& farthest_m);

 private:
  int block_px_;
  cv::Mat1f floor_m_;
  cv::Mat1b sectors_;
  cv::Size marked_px_;      ///< whole rows of strips
  std::vector<Strip> all_;  ///< blocks for pixels, as in what follows
  BitMask bits_;
  BitArea area_;
  Labeller labeller_;
};

}  // namespace omnifleet::ground
