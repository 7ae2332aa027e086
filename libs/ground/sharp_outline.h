#pragma once

#include <opencv2/core.hpp>

#include "ground/floor_frame.h"
#include "ground/labelling.h"

namespace omnifleet::ground {

/// Decides whether a region of the floor's hue is an object, not a fading patch of light or shadow. Most of
/// an object's outline is an intensity edge: at least half of the region's mean difference from the floor, or
/// half of the difference just inside the outline.
struct OutlineSharpness {
  float share;        ///< of the outline that is an edge
  float light;        ///< of the outline that is plainly lighter than the floor
  float light_share;  ///< of these lighter pixels that are at an edge
};

/// @param appearances of the pixels (appearance_class.h)
OutlineSharpness sharpnessOfOutline(const Blob& blob, const FloorFrame& frame, const cv::Mat1b& appearances);

}  // namespace omnifleet::ground
