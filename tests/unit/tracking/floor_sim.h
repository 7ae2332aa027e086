#pragma once

// Analytic replacement for camera and local mapper: closed-form silhouettes of upright prisms on the floor.
// The silhouette of a prism is the hull of its floor polygon and of its top polygon scaled about the camera's
// foot by s = H/(H − h), H the camera height. Silhouettes that touch merge into one blob, as in an image. The
// true bodies of each blob are returned as well.

#include <functional>
#include <random>
#include <string>
#include <vector>

#include "observation/observation.h"

namespace omnifleet::sim {

/// Which part of a body differs from the floor.
enum class Shows {
  kAll,
  kTop,  ///< the sides look like the floor
  kHint  ///< no part is segmented; the scan is undecided there
};

struct Body {
  std::string name;
  Shows shows = Shows::kAll;
  bool robot = false;
  bool publishes = true;  ///< robots only
  bool declared = true;   ///< robots only: listed in the fleet. Unlisted robots come after the listed ones
  Polygon outline;        ///< in its own frame, convex, about its centre
  double height_m = 0.2;
  Pose2 pose;  ///< map_from_body
  double v_mps = 0.0, w_radps = 0.0;
};

struct Noise {
  double vertex_px = 0.3;                  ///< of every vertex of a silhouette, radially and across
  double focal_scale = 1.0;                ///< believed focal length ÷ true one
  double wheels = 0.02;                    ///< relative, of each step
  double turn_rad = 0.001;                 ///< of each step
  double pose_m = 0.01, pose_rad = 0.005;  ///< of published poses
};

struct Scene {
  std::vector<Body> bodies;  ///< robots first
  double camera_height_m = 0.5;
  double focal_px = 297.0;  ///< equidistant, 1280×960, 185°
  double sight_m = 2.5;     ///< m, objects with a farther contact are not reported
  double step_s = 0.1;
  Noise noise;

  /// Moves every body by one step along its arc.
  void advance();
  /// Sets the wheel speeds so that the robots turn away from near objects and touch nothing.
  void steerClear(double speed_mps, std::mt19937& rng);
};

Body round(const std::string& name, double radius_m, double height_m, const Pose2& pose);
Body box(const std::string& name, double length_m, double width_m, double height_m, const Pose2& pose);

/// Local map of robot `self` at one moment. `before`: the scene one frame earlier, nullptr for the first
/// frame. `blob_bodies[i]`: bodies in blob i.
LocalMap localMapOf(const Scene& scene, std::size_t self, const Scene* before, int frame, std::mt19937& rng,
                    std::vector<std::vector<std::size_t>>* blob_bodies = nullptr);

/// Published poses of the robots in this scene.
std::vector<PoseEstimate> publish(const Scene& scene, int frame, std::mt19937& rng);

/// True gap between two bodies' outlines (0 where they touch).
double gap(const Body& a, const Body& b);

}  // namespace omnifleet::sim
