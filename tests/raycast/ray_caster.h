#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <vector>

#include "dataset/map_files.h"
#include "geometry/pose2.h"
#include "lens/camera.h"

/// A second renderer for tests. It shares no code with `synthetic`, so a result that holds for both was not
/// tuned to one of them. Lamps light Lambert surfaces, with four samples per pixel and the tone curve of
/// sRGB; the floors imitate real ones. Colours are linear albedos (R, G, B). Lengths are metres, in map.
namespace omnifleet::raycast {

enum class Surface {
  kMatt,
  kMirror,  ///< reflects 90 % of the light
  kGlass,   ///< reflects 8 %, lets 88 % through
};

/// Rectangle on a vertical side of a solid: a door, a skirting board, a radiator.
struct Panel {
  Eigen::Vector2d normal = Eigen::Vector2d::Zero();  ///< of the side, in the frame of the solid
  double begin_m = 0.0, end_m = 0.0;  ///< along the side, from its middle, anticlockwise seen from above
  double bottom_m = 0.0, top_m = 0.0;
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();
  double stripe_m = 0.0;  ///< period of vertical stripes; 0: none
};

/// Details on the vertical sides of furniture.
enum class Front { kPlain, kBooks, kDoors, kDrawers, kCushions };

struct Solid {
  bool round = false;    ///< true: an upright cylinder of diameter size_m.x(); false: a box
  Pose2 map_from_solid;  ///< centre of the footprint
  Eigen::Vector2d size_m = Eigen::Vector2d::Zero();
  double height_m = 0.0;
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();
  bool chequered = false;
  Surface surface = Surface::kMatt;
  std::vector<Panel> panels = {};  ///< later ones hide earlier ones; boxes only
  Front front = Front::kPlain;
  unsigned texture = 0;  ///< seed of the front's details
};

/// A flat rectangle on the floor: tape or a sheet of paper.
struct FloorMarking {
  Pose2 map_from_marking;
  Eigen::Vector2d size_m = Eigen::Vector2d::Zero();
  Eigen::Vector3d albedo = Eigen::Vector3d::Zero();
};

struct Lamp {
  Eigen::Vector3d at_m = Eigen::Vector3d::Zero();
  double power = 1.0;
  double radius_m = 0.0;  ///< of the luminous disc, which softens its shadows; 0: no shadows
};

enum class Floor { kLino, kParquet, kCarpet, kConcrete, kPlain };

struct Room {
  Floor floor = Floor::kLino;
  Eigen::Vector3d floor_albedo = Eigen::Vector3d::Constant(0.4);
  std::vector<Solid> solids;
  std::vector<FloorMarking> markings;
  std::vector<Lamp> lamps;
  double light = 1.0;      ///< factor on all light
  double ambient = 0.35;   ///< light without direction
  double vignette = 0.0;   ///< share of the light lost at 90° off the axis; ∝ square of the angle
  bool is_linear = false;  ///< response of the camera; false: tone curve of sRGB
  double noise = 1.5;      ///< σ, grey levels
  unsigned seed = 0;       ///< of textures and noise
};

/// Renders the image (BGR) of a camera at `map_from_camera` that looks straight down from the height
/// camera.position_m.z().
/// @param camera equidistant, equisolid or stereographic
/// @param robots bodies of the other robots at this time
/// @param frame number that selects the noise
cv::Mat3b render(const Room& room, const lens::CameraModel& camera, const Pose2& map_from_camera,
                 const std::vector<Solid>& robots, unsigned frame);

/// Footprint of a solid as an object of the truth.
dataset::MapObject truthOf(const Solid& solid, std::uint64_t id);

}  // namespace omnifleet::raycast
