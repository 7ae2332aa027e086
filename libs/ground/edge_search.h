#pragma once

#include <cstdint>

#include "geometry/lanes.h"
namespace omnifleet::ground {

struct ContourFrame;
struct ContourOptions;

/// Eight points of an outline with their inputs and results, one lane per point.
struct EightEdges {
  static constexpr int kCount = lanes::kLanes;
  float x_px[kCount], y_px[kCount];        ///< input: the points; output: the edges that were found
  float along_x[kCount], along_y[kCount];  ///< direction of the outline, region on its right (v down)
  float floor[3][kCount];                  ///< floor reference: blue, green, red
  std::int32_t beside[kCount];             ///< not 0 where another object, not floor, is on the left
  std::int32_t found[kCount];              ///< output: not 0 where an edge was found
};

/// Searches along the normals of eight points for the position halfway between floor (or another object
/// beside) and object in brightness. Where the brightness hardly differs it uses the colour. Without colours
/// all three channels are the brightness.
void findEdges(const ContourFrame& frame, const ContourOptions& options, EightEdges& edges);

}  // namespace omnifleet::ground
