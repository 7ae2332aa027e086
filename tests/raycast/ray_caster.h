#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "dataset/map_files.h"
#include "geometry/pose2.h"
#include "lens/camera.h"

/// A second renderer, for tests: it shares no line with `synthetic`, so what the fleet does well in both it
/// has not learned from one. Light of two lamps on surfaces (Lambert), four samples a pixel, the tone curve
/// of sRGB, and floors that people have. Colours are linear albedos (R, G, B), lengths metres, in map.
namespace omnifleet::raycast {

struct Solid {
  bool round = false;    ///< an upright cylinder of diameter size_m.x(), else a box
  Pose2 map_from_solid;  ///< its middle, on the floor
  Eigen::Vector2d size_m = Eigen::Vector2d::Zero();
  double height_m = 0.0;
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();
  bool chequered = false;
};

/// Flat, on the floor: tape, a sheet of paper.
struct Mark {
  Pose2 map_from_mark;
  Eigen::Vector2d size_m = Eigen::Vector2d::Zero();
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();
};

struct Lamp {
  Eigen::Vector3d at_m = Eigen::Vector3d::Zero();
  double power = 1.0;
  double radius_m = 0.0;  ///< of the disc that it is: so soft are its shadows; 0: it casts none
};

enum class Floor { kLino, kParquet, kCarpet, kConcrete };

struct Room {
  Floor floor = Floor::kLino;
  Eigen::Vector3d floor_albedo = Eigen::Vector3d::Constant(0.4);
  std::vector<Solid> solids;
  std::vector<Mark> marks;
  std::vector<Lamp> lamps;
  double light = 1.0;
  double ambient = 0.35;   ///< light from all around
  double vignette = 0.0;   ///< share of the light that is lost at the horizon, as the square of the angle
  bool is_linear = false;  ///< the camera's response; else sRGB's tone curve
  double noise = 1.5;      ///< grey levels
  unsigned seed = 0;       ///< of textures and noise
};

/// What a camera that looks straight down from `height_m` over `map_from_camera` sees.
/// @param camera equidistant, equisolid or stereographic @param robots likewise solid, of this moment
/// @param frame another number, other noise
cv::Mat3b render(const Room& room, const lens::CameraModel& camera, const Pose2& map_from_camera,
                 const std::vector<Solid>& robots, unsigned frame);

/// The footprint, as truth has it.
dataset::MapObject truthOf(const Solid& solid, std::uint64_t id);

}  // namespace omnifleet::raycast
