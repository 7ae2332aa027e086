#pragma once

#include <cmath>
#include <limits>
#include <map>
#include <string>
#include <vector>

#include "dataset/map_files.h"
#include "dataset/trajectory_files.h"
#include "geometry/pose2.h"

namespace omnifleet::evaluation {

/// Occupied cells and true faces of one class. A face is an edge of the scene or of the room. Shares are NaN
/// without cells or points.
struct FaceMetrics {
  int cells = 0;  ///< occupied cells whose nearest face has this class; those of CellMetrics::filled excluded
  double within_1_5cm =
      std::numeric_limits<double>::quiet_NaN();                  ///< share of them within kTight_m of a face
  double within_2cm = std::numeric_limits<double>::quiet_NaN();  ///< share of them within kNear_m of a face
  double within_5cm = std::numeric_limits<double>::quiet_NaN();  ///< share of them within kWide_m of a face
  int seen = 0;  ///< face points, 1 cm apart, that a robot has seen from within kSeen_m
  double seen_occupied = std::numeric_limits<double>::quiet_NaN();  ///< share of them within kNear_m of an
                                                                    ///< occupied cell
};

/// Accuracy of an occupancy grid at the true faces. Distances are those between a cell's square and a face, 0
/// where the face crosses or touches the square.
struct CellMetrics {
  int occupied = 0;  ///< all occupied cells
  int filled = 0;   ///< of them inside both an obstacle and a closed outline of the run, off the faces: drawn
                    ///< by design and counted nowhere else
  FaceMetrics all;  ///< both classes; cells without any true face have no share
  FaceMetrics obstacles;  ///< faces of the scene, also where a wall is as near
  FaceMetrics structure;  ///< faces of the room
  int crossed = 0;        ///< cells that contain a face point seen from within kCrossed_m
  double occupied_per_crossed = std::numeric_limits<double>::quiet_NaN();  ///< without filled cells
  /// Mean distance of the cells from their faces, where a robot saw the nearest point of the face from within
  /// kClose_m, and elsewhere. Of the cells counted in `all`; NaN without any.
  double near_error_m = std::numeric_limits<double>::quiet_NaN();
  double far_error_m = std::numeric_limits<double>::quiet_NaN();
  int on_robots = 0;  ///< occupied cells whose centre lay in the body of a robot at any time
  int free = 0;       ///< free cells
  double free_wrong = std::numeric_limits<double>::quiet_NaN();  ///< share of them whose centre lies inside
                                                                 ///< an obstacle or outside the room

  double free_complete =
      std::numeric_limits<double>::quiet_NaN();  ///< share of the floor of the room that is
                                                 ///< free in the map; NaN without a room

  static constexpr double kTight_m = 0.015, kNear_m = 0.02, kWide_m = 0.05;
  static constexpr double kClose_m = 1.0, kSeen_m = 1.8, kCrossed_m = 3.0;
  static constexpr double kFaceStep_m = 0.01;  ///< between face points
  static constexpr double kPathStep_m = 0.1;   ///< least distance between positions of a robot, …
  static constexpr double kTurnStep_rad =
      0.1;                                 ///< … or least rotation, if its camera does not see all around
  static constexpr double kEnd_m = 0.003;  ///< at the end of a line of sight, faces do not occlude
};

/// A robot of the truth.
struct TrueRobot {
  std::vector<dataset::StampedPose> path;
  double half_view_rad = M_PI;   ///< the camera sees so far to both sides of its axis; 0: no camera
  Polygon body_m;                ///< base_link; empty: unknown
  double body_height_m = 0.0;    ///< over the floor; 0: unknown, hides nothing
  Pose2 base_from_camera{};      ///< optical centre and axis of the camera, on the floor
  double camera_height_m = 0.0;  ///< over the floor; 0: unknown, robots hide nothing from it
};

/// A robot has seen a face point if the line from one of its true camera positions crosses no other face and
/// passes over the bodies of the other robots, where they were at that time, on its way to the foot of the
/// face.
/// @param grid in the frame of the run
/// @param truth_from_map aligns the run with the truth
/// @param found objects of the run, in the frame of the truth; outlines of kind "obstacle" are used
/// @param scene objects of kind "obstacle" are compared
/// @param room inner side of the walls; empty: unknown
CellMetrics compareCells(const dataset::OccupancyGrid& grid, const Pose2& truth_from_map,
                         const std::vector<dataset::MapObject>& found,
                         const std::vector<dataset::MapObject>& scene, const Polygon& room,
                         const std::map<std::string, TrueRobot>& robots);

}  // namespace omnifleet::evaluation
