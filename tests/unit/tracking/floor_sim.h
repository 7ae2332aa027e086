#pragma once

// An analytic stand-in for camera and local mapper: closed-form silhouettes of upright prisms on the floor.
// The hull of the floor polygon and the top polygon scaled about the camera's foot by s = H/(H − h) is what a
// camera at height H sees; blobs whose silhouettes touch run together, as in an image. Truth comes along.

#include <functional>
#include <random>
#include <string>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::sim {

/// How much of a body differs from the floor.
enum class Shows {
  kAll,
  kTop,  ///< its sides look like the floor
  kHint  ///< something is there: the scan leaves it undecided
};

struct Body {
  std::string name;
  Shows shows = Shows::kAll;
  bool robot = false;
  bool publishes = true;  ///< robots only
  bool declared = true;   ///< robots only: of the fleet; others carry nothing of ours, and come after these
  Polygon outline;        ///< in its own frame, convex, about its centre
  double height_m = 0.2;
  Pose2 pose;  ///< map_from_body
  double v_mps = 0.0, w_radps = 0.0;
};

struct Noise {
  double vertex_px = 0.3;                  ///< of every vertex of a silhouette, radially and across
  double focal_scale = 1.0;                ///< what the camera believes ÷ truth
  double wheels = 0.02;                    ///< relative, of each step
  double turn_rad = 0.001;                 ///< of each step
  double pose_m = 0.01, pose_rad = 0.005;  ///< of published poses
};

struct Scene {
  std::vector<Body> bodies;  ///< robots first
  double camera_height_m = 0.5;
  double focal_px = 297.0;  ///< equidistant, 1280×960, 185°
  double sight_m = 2.5;     ///< contact farther away is not reported
  double step_s = 0.1;
  Noise noise;

  /// Every body one step on, along its own arc.
  void advance();
  /// Wheels that turn away from what is near: robots roam without ever touching anything.
  void steerClear(double speed_mps, std::mt19937& rng);
};

Body round(const std::string& name, double radius_m, double height_m, const Pose2& pose);
Body box(const std::string& name, double length_m, double width_m, double height_m, const Pose2& pose);

/// What robot `self` sees of the scene at one moment. `before`: the scene one frame earlier, or nullptr at
/// the start. `blob_bodies[i]`: bodies in blob i.
LocalMap look(const Scene& scene, std::size_t self, const Scene* before, int frame, std::mt19937& rng,
              std::vector<std::vector<std::size_t>>* blob_bodies = nullptr);

/// Poses that the robots would publish for this scene.
std::vector<PoseEstimate> publish(const Scene& scene, int frame, std::mt19937& rng);

/// True gap between two bodies' outlines (0 where they touch).
double gap(const Body& a, const Body& b);

}  // namespace omnifleet::sim
