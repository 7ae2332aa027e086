#pragma once

#include <string>
#include <vector>

#include "distance_vector/scale_fit.h"

namespace omnifleet::ahmed {

/// Table 1 for the cameras of an arena.
struct Calibration {
  std::vector<distance_vector::ScalePair> pairs;
  double metres_per_ceiling_px = 0.0;  ///< of the floor, between the nearest and the farthest object
};

/// Ten experiments as in §2.3 of Ahmed et al. 2013, rendered by tests/raycast with the cameras of
/// raycast_arena: a box stands ahead of r1, farther away each time. d_r is what the distance vector of the
/// product measures in the middle of the image, in pixels from the bottom row. d_c is the distance between
/// the robot, found by its marker, and the foot of the box in the image of ceiling camera c1, in pixels. The
/// box is where a person sees it: this place is the true one. Distances are spread evenly in d_r, as in
/// Table 1.
/// @param seed of the cameras' tolerances and of the noise
/// @param folder receives pairs.csv and the images (front_0.png, ceiling_0.png, …); created if missing
/// Throws std::runtime_error if the robot or the box is not seen.
Calibration calibrate(unsigned seed, const std::string& folder);

}  // namespace omnifleet::ahmed
