#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/deep_shade.h"
#include "ground/floor_frame.h"
#include "ground/labelling.h"
#include "ground/look.h"

namespace omnifleet::ground {

/// What hangs together with a thing in the picture and looks like its shadow may be a low wall behind it, of
/// the floor's hue and in less light, in pieces where things hide it: as long and thin as no thing's shadow
/// is, and some of its outline as sharp.
class BoardFinder {
 public:
  explicit BoardFinder(cv::Size image) : left_(image), deep_(image) {}

  /// Cheap; most regions hold none.
  /// @param shaded_px pixels in less light than the floor, of its hue
  bool mayBeIn(const Blob& region, int shaded_px) const;
  /// @param things what of the region is more than shade @param area where that is known
  /// @return pieces of the rest, valid until the next call
  const std::vector<const Blob*>& find(const Blob& region, const BitMask& things, const BitArea& area,
                                       const FloorFrame& frame, const cv::Mat1b& looks);

 private:
  bool isLarge(const cv::Rect& rect) const;

  BitMask left_;  ///< of the region, what is none of the things
  Labeller labeller_;
  DeepShade deep_;
  std::vector<const Blob*> pieces_;
};

}  // namespace omnifleet::ground
