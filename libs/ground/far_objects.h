#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "ground/bit_mask.h"
#include "ground/labelling.h"
#include "lens/camera.h"

namespace omnifleet::ground {

/// Restores far objects that the line filter removed. Far away, most of all towards the rim of an
/// orthographic lens, whole objects are as thin in the image as near floor markings. A region is restored if
/// it disappeared as a whole and would be, lying on the floor, wider than markings and no longer than
/// objects.
class FarObjects {
 public:
  explicit FarObjects(const lens::Camera& camera) : camera_(camera) {}

  /// @param regions before the line filter, with markings
  /// @param bits after the line filter; pixels of restored regions are set
  /// @return true if any region was restored
  bool restore(const std::vector<Blob>& regions, BitMask& bits) const;

 private:
  bool isObject(const Blob& region) const;

  lens::Camera camera_;
};

}  // namespace omnifleet::ground
