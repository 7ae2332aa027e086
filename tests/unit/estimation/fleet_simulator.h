#pragma once

#include <cstdint>
#include <random>
#include <string>
#include <vector>

#include "estimation/estimator.h"
#include "observation/observation.h"

namespace omnifleet::estimation::testing {

/// A prism on the floor, in map; a circle where radius_m > 0.
struct Prism {
  Polygon outline_m;
  Eigen::Vector2d centre_m = Eigen::Vector2d::Zero();
  double radius_m = 0.0;
  double height_m = 0.0;
  /// Support of the footprint in map direction n.
  double support(const Eigen::Vector2d& n) const;
};

struct SimulationOptions {
  int robots = 3, obstacles = 6;
  int frames = 60;
  double period_s = 0.2;
  double speed_mps = 0.25;
  double wheel_bias_sigma = 0.02, wheel_noise = 0.02;  ///< 1, of the distance rolled
  double pixel_sigma_px = 0.4;
  double focal_px = 297.0, camera_height_m = 0.5;  ///< give the noise on the floor
  bool orthographic = false;                       ///< the lens, r = F·sin θ; else equidistant, r = F·θ
  /// σ of the calibration errors, drawn per robot: focal length and height (relative), roll and pitch (rad).
  Eigen::Vector4d camera_sigma = Eigen::Vector4d::Zero();
  /// Common relative error of all calibrated camera heights: (calibrated − true) / true.
  double height_error = 0.0;
  double outline_bias_rad = 0.0;  ///< every outline is too large by this angle at the camera
  double shadow_m = 0.0;          ///< shadow: every outline is extended towards −y of map
  double initial_sigma_m = 0.0, initial_sigma_rad = 0.0;  ///< errors of the initial poses
  bool obstacles_seen = true, robots_seen = true, wheels = true;
  int kidnapped_at = 0;                           ///< first frame after the kidnapping of r1 (0: never)
  double kidnapped_m = 0.0, kidnapped_rad = 0.0;  ///< from the pose by its wheels
  bool all_kidnapped = false;  ///< all robots by the same translation in map, each turned in place
  bool equal_discs = false;    ///< all obstacles are equal discs
  double sight_m = 2.0;        ///< range up to which obstacles and robots are observed
};

/// Exact paths and silhouettes; noise from one seed. Independent of the estimator's own formulas. A
/// silhouette is the hull of the floor polygon and of the top polygon scaled about the camera's foot. Each of
/// its points is projected by the real camera and back to the floor by the calibrated one.
class FleetSimulator {
 public:
  FleetSimulator(const SimulationOptions& options, std::uint32_t seed);

  std::vector<RobotSetup> setups() const;
  TimeNs time(int frame) const;
  const Pose2& truth(int robot, int frame) const;
  const std::vector<Prism>& obstacles() const { return obstacles_; }
  const Eigen::Vector2d& bias(int robot) const { return bias_[static_cast<std::size_t>(robot)]; }
  /// Calibration minus truth.
  const Eigen::Vector4d& cameraError(int robot) const { return camera_[static_cast<std::size_t>(robot)]; }
  static std::string name(int robot) { return "r" + std::to_string(robot + 1); }

  /// The frames of all robots at one time; call in order.
  std::vector<Objects> frames(int frame);
  std::mt19937& random() { return random_; }
  double gauss(double sigma) { return std::normal_distribution<double>(0.0, sigma)(random_); }

  RobotBody body;

 private:
  void placeObstacles();
  bool drive();
  Pose2 kidnapped(const Pose2& before, double direction_rad) const;
  Motion wheels(int robot, int frame);
  double radiusOf(double theta_rad) const;
  double angleOf(double radius) const;
  void enlarge(std::vector<Eigen::Vector2d>& points) const;
  Eigen::Vector2d throughCamera(int robot, const Eigen::Vector2d& floor_m) const;
  Track observe(int robot, int frame, const Prism& prism, std::uint32_t id, ObjectKind kind);

  SimulationOptions options_;
  std::uint32_t seed_;
  std::mt19937 random_;
  std::vector<Prism> obstacles_;
  std::vector<Eigen::Vector2d> bias_;
  std::vector<Eigen::Vector4d> camera_;
  std::vector<std::vector<Pose2>> truth_;
  std::vector<std::vector<Eigen::Vector2d>> rolled_;  ///< true travel of left and right wheel
};

/// Arguments of FleetEstimator::process().
std::vector<const Objects*> pointers(const std::vector<Objects>& frames);

/// Errors of one run.
struct RunResult {
  double mean_m = 0.0, worst_m = 0.0, mean_rad = 0.0;
  double nees = 0.0;  ///< mean of eᵀP⁻¹e over frames and robots; 3 where consistent
  int estimates = 0, frames = 0;
  double heading_nees = 0.0;                         ///< of the heading alone; 1 where consistent
  Eigen::Vector4d camera = Eigen::Vector4d::Zero();  ///< rms of the errors of the cameras' estimates
  double landmark_m = 0.0;  ///< mean distance of published landmarks to the nearest obstacle's centroid
  int landmarks = 0;
};
RunResult run(const SimulationOptions& simulation, EstimatorOptions options, std::uint32_t seed);

}  // namespace omnifleet::estimation::testing
