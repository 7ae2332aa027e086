#pragma once

#include <opencv2/core.hpp>

#include "ground/floor_frame.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Is a region of the floor's hue a thing, not a patch of light or shade that fades? Most of its outline is
/// then a step: by half of what the region differs from the floor by on the whole, or of what lies right
/// inside.
struct OutlineSharpness {
  float share;        ///< of the outline that is a step
  float light;        ///< of the outline, pixels plainly lighter than the floor
  float light_share;  ///< of those that are at a step
};

/// @param looks of the pixels (look.h)
OutlineSharpness sharpnessOfOutline(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& looks);

}  // namespace omnifleet::ground
