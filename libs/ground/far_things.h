#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/labelling.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Far off, most of all towards the rim of an orthographic lens, whole things are as thin in the picture as
/// markings of the floor are near by, and go with them. What went all at once, and as it lies there would be
/// wider than markings are and no longer than things, is given back.
class FarThings {
 public:
  explicit FarThings(const lens::Camera& camera) : camera_(camera) {}

  /// @param regions with the markings
  /// @param bits without; what is given back is set
  /// @return whether anything was
  bool giveBack(const std::vector<Blob>& regions, BitMask& bits) const;

 private:
  bool isThing(const Blob& region) const;

  lens::Camera camera_;
};

}  // namespace omnifleet::ground
