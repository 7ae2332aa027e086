#pragma once

#include <optional>

namespace omnifleet::raycast {

enum class Furniture {
  kTall,  ///< cupboards, shelves, sofas, tables as boxes, chairs, pillars: most higher than the camera
  kLow,   ///< free-standing boxes and cylinders lower than the camera
};

/// Half-open interval of time, seconds from the first frame.
struct Interval {
  double begin_s = 0.0, end_s = 0.0;
  bool contains(double time_s) const { return time_s >= begin_s && time_s < end_s; }
};

struct FurnishedOptions {
  unsigned seed = 0;  ///< of room, paths and noise
  int robots = 1;
  int frames = 200;         ///< per robot
  double duration_s = 0.0;  ///< > 0: length of the drive; replaces `frames`
  double rate_hz = 5.0;
  double step_min_m = 0.0,
         step_max_m = 0.0;  ///< > 0: images by distance instead of time, at random in between
  bool loop = false;        ///< one robot tours the room and returns to its first place; needs steps
  int width_px = 1280, height_px = 960;
  int pieces = 10;  ///< of furniture
  Furniture furniture = Furniture::kTall;
  int rooms = 1;                                ///< 2: joined by a door
  double width_min_m = 5.2, width_max_m = 6.4;  ///< of the first room, along x
  double depth_min_m = 4.2, depth_max_m = 5.2;  ///< of all rooms, along y
  bool decorated = false;  ///< doors, radiators, curtains, skirting boards, books, drawers
  bool fast = false;       ///< renderAdaptive() in place of render()
  bool walls = true;
  bool dim = false;        ///< low contrast, light that falls off towards the walls
  bool mirror = false;     ///< a mirror of 1.4 x 2 m stands at a wall
  bool glass = false;      ///< 1.6 m of a wall are glass; behind it floor
  bool symmetric = false;  ///< the room equals itself turned by 180° about the origin; plain floor
  bool wheels = true;
  double wheel_noise = 0.02;                          ///< σ of each row's relative error
  double wheel_bias = 0.015;                          ///< σ of each wheel's scale error
  double focal_error = 0.0;                           ///< relative error of the focal length in sensor.yaml
  double tilt_error_deg = 0.0;                        ///< error of roll and pitch in sensor.yaml
  double start_error_m = 0.0, start_error_rad = 0.0;  ///< error of each initial_pose

  // Faults. The ground truth stays true.
  std::optional<Interval> black;      ///< frames of the first robot are black
  std::optional<Interval> slip;       ///< wheels of the first robot turn 40 % farther than it moves
  std::optional<double> kidnapped_s;  ///< the first robot is lifted at this time and set down 2 s later
  double occluded_share = 0.0;  ///< of the first robot's bearings, by persons within 1.5 m; mean over time
  double wheel_clock_offset_s = 0.0;  ///< clock of the wheels minus clock of the cameras
  double wheel_speed_factor = 1.0;    ///< 100: wheel speeds in cm/s
};

inline constexpr double kSlip = 1.4;         ///< wheel path per way during `slip`
inline constexpr double kKidnapped_s = 2.0;  ///< from lifting to setting down

}  // namespace omnifleet::raycast
