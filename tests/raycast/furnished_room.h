#pragma once

#include <string>
#include <vector>

#include "tests/raycast/ray_caster.h"

namespace omnifleet::raycast {

enum class Furniture {
  kTall,  ///< cupboards, shelves, sofas, tables as boxes, chairs, pillars: most higher than the camera
  kLow,   ///< free-standing boxes and cylinders lower than the camera
};

struct FurnishedOptions {
  unsigned seed = 0;  ///< of room, paths and noise
  int robots = 1;
  int frames = 200;  ///< per robot
  double rate_hz = 5.0;
  double step_min_m = 0.0,
         step_max_m = 0.0;  ///< > 0: images by distance instead of time, at random in between
  int width_px = 1280, height_px = 960;
  int pieces = 10;  ///< of furniture
  Furniture furniture = Furniture::kTall;
  int rooms = 1;  ///< 2: joined by a door
  bool walls = true;
  bool dim = false;  ///< low contrast, light that falls off towards the walls
  bool wheels = true;
  double wheel_bias = 0.015;                          ///< σ of each wheel's scale error
  double focal_error = 0.0;                           ///< relative error of the focal length in sensor.yaml
  double tilt_error_deg = 0.0;                        ///< error of roll and pitch in sensor.yaml
  double start_error_m = 0.0, start_error_rad = 0.0;  ///< error of each initial_pose
};

/// Robots drive smooth paths between random goals in a furnished room; writes a data set with poses,
/// footprints of the furniture (scene.geojson) and the inside of the walls (room.geojson). Throws
/// std::runtime_error if no free path exists or a file cannot be written.
void recordFurnished(const std::string& folder, const FurnishedOptions& options);

}  // namespace omnifleet::raycast
