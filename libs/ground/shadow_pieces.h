#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/appearance_class.h"
#include "ground/bit_mask.h"
#include "ground/deep_shadow.h"
#include "ground/floor_frame.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Pieces that are connected to an object in the image and resemble its shadow, but may be something else.
/// - A board: a low wall behind the object, of the floor's hue and in less light, in pieces where objects
/// hide it. It is longer and thinner than any object's shadow, and part of its outline is sharp.
/// - A face: another object of the floor's hue, beside or behind the first. It is large, and most of its
/// outline is sharp, except where it stands on the floor, which is in its own shadow there. Shadows with
/// sharp rims have them all around.
class ShadowPieces {
 public:
  explicit ShadowPieces(cv::Size image) : left_(image), deep_(image) {}

  /// Cheap test; most regions hold no such piece.
  /// @param shadowed_px pixels in less light than the floor, of its hue
  bool mayBeIn(const Blob& region, int shadowed_px) const {
    return mayBeBoard(region, shadowed_px) || mayBeFace(shadowed_px);
  }
  /// @param objects pixels of the region that are not shadow @param area where these are known
  void find(const Blob& region, const BitMask& objects, const BitArea& area, const FloorFrame& frame,
            const cv::Mat1b& appearances);
  /// Of the last region; valid until the next call of find().
  const std::vector<const Blob*>& boards() const { return boards_; }
  const std::vector<const Blob*>& faces() const { return faces_; }

 private:
  bool mayBeBoard(const Blob& region, int shadowed_px) const;
  bool mayBeFace(int shadowed_px) const;
  bool isLarge(const cv::Rect& rect) const;
  void dropOtherPieces();

  BitMask left_;  ///< pixels of the region that do not belong to the objects
  Labeller labeller_;
  DeepShadow deep_;
  std::vector<const Blob*> boards_, faces_;
};

}  // namespace omnifleet::ground
