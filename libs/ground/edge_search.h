#pragma once

#include <cstdint>

#include "geometry/lanes.h"
namespace omnifleet::ground {

struct ContourFrame;
struct ContourOptions;

/// Eight points of an outline, each with what is known of it: one number of each a lane.
struct EightEdges {
  static constexpr int kCount = lanes::kLanes;
  float x_px[kCount], y_px[kCount];        ///< in: the points; out: the edges, where one was found
  float along_x[kCount], along_y[kCount];  ///< direction of the outline, the region on its right (v down)
  float floor[3][kCount];                  ///< reference: blue, green, red
  std::int32_t beside[kCount];             ///< not 0 where another thing, no floor, lies on the left
  std::int32_t found[kCount];              ///< out: not 0 where there is an edge
};

/// Looks along the normals of eight points for the place that is halfway between floor (or what else lies
/// beside) and object in brightness; where brightness hardly differs, in colour. Of a frame without colours
/// all three channels are its brightness.
void findEdges(const ContourFrame& frame, const ContourOptions& options, EightEdges& edges);

}  // namespace omnifleet::ground
