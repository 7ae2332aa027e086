#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/deep_shade.h"
#include "ground/floor_frame.h"
#include "ground/labelling.h"
#include "ground/look.h"

namespace omnifleet::ground {

/// What hangs together with a thing in the picture and looks like its shadow may be something else.
///  - A board: a low wall behind it, of the floor's hue and in less light, in pieces where things hide it: as
///    long and thin as no thing's shadow is, and some of its outline as sharp.
///  - A face: another thing of the floor's hue, beside or behind it: as large, and most of its outline as
///    sharp, but not where it stands on the floor, which is in its own shadow there. Shadows with sharp rims
///    have them all around.
class ShadePieces {
 public:
  explicit ShadePieces(cv::Size image) : left_(image), deep_(image) {}

  /// Cheap; most regions hold none.
  /// @param shaded_px pixels in less light than the floor, of its hue
  bool mayBeIn(const Blob& region, int shaded_px) const {
    return mayBeBoard(region, shaded_px) || mayBeFace(shaded_px);
  }
  /// @param things what of the region is more than shade @param area where that is known
  void find(const Blob& region, const BitMask& things, const BitArea& area, const FloorFrame& frame,
            const cv::Mat1b& looks);
  /// Of the last region; valid until the next one.
  const std::vector<const Blob*>& boards() const { return boards_; }
  const std::vector<const Blob*>& faces() const { return faces_; }

 private:
  bool mayBeBoard(const Blob& region, int shaded_px) const;
  bool mayBeFace(int shaded_px) const;
  bool isLarge(const cv::Rect& rect) const;
  void dropNoBoards();

  BitMask left_;  ///< of the region, what is none of the things
  Labeller labeller_;
  DeepShade deep_;
  std::vector<const Blob*> boards_, faces_;
};

}  // namespace omnifleet::ground
