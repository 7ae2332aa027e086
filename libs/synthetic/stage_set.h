#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstdint>
#include <vector>

#include "synthetic/arena.h"
#include "synthetic/pixel_table.h"
#include "synthetic/tracer.h"

namespace omnifleet::synthetic {

/// All solids that one camera can see: obstacles, walls, and the other robots. Holds their poses at one frame
/// and their colour at a surface point.
class StageSet {
 public:
  /// `own_robot`: the robot that carries the camera, which is excluded; −1: none.
  StageSet(const Arena& arena, int own_robot, std::uint32_t seed);

  /// Sets the poses of all robots at the time of the frame. `parent_from_map` belongs to the parent frame of
  /// the camera.
  void place(const Arena& arena, double time_s, const std::vector<Pose2>& map_from_bases,
             const Pose2& parent_from_map);

  /// True if a solid may be visible within the cone. Call aim() before.
  bool mayShow(const PixelTable::Cone& cone) const;
  /// Computes the directions of all solids from the camera position `camera_m` (parent frame). Call after
  /// place().
  void aim(const Eigen::Vector3f& camera_m);

  const Tracer& tracer() const { return tracer_; }

  /// Unique number of a face of a solid, and its colour at a point of the parent frame.
  int faceId(int solid, int triangle) const;
  Eigen::Array4f colour(int solid, int triangle, const Eigen::Vector3f& point_m) const;

 private:
  struct Ball {
    int solid;
    Eigen::Vector3f centre_m;  ///< in the frame of the solid
    float radius_m;
  };
  struct Aim {
    Eigen::Vector3f direction;
    float half_angle_rad;
  };
  static std::vector<SolidMesh> meshes(const Arena& arena, int own_robot);
  void addBalls(int solid, const SolidMesh& mesh, const Eigen::Vector2d& size_m);

  std::vector<SolidMesh> meshes_;
  Tracer tracer_;
  std::vector<int>
      robots_;  ///< indices of the robots that follow the obstacles and walls in the numbering of solids
  std::uint32_t seed_;
  Light light_;
  double time_s_ = 0.0;
  Pose2 map_from_parent_;
  std::vector<Pose2> map_from_solids_;
  std::vector<Eigen::Affine3f> parent_from_solids_, solids_from_parent_;
  std::vector<Ball> balls_;
  std::vector<Aim> aims_;
};

}  // namespace omnifleet::synthetic
