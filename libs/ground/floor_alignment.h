#pragma once

#include <Eigen/Core>
#include <opencv2/core.hpp>
#include <optional>
#include <vector>

#include "geometry/pose2.h"
#include "ground/floor_comparison.h"
#include "ground/floor_raster.h"
#include "ground/floor_view.h"
#include "lens/camera.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::ground {

struct FloorAlignmentOptions {
  double inner_m = 0.45;          ///< m, from the foot of the camera: inner limit of the floor that is used
  double outer_m = 1.10;          ///< m, outer limit
  double cell_m = 0.01;           ///< m, side of a cell of the raster
  double reach_m = 0.22;          ///< m, distance from the reference beyond which it is replaced
  double reach_rad = 0.35;        ///< rad, likewise
  int iterations = 16;            ///< Gauss–Newton steps, at most
  int min_cells = 1500;           ///< fewer compared cells are no result
  double min_correlation = 0.20;  ///< 1, normalised correlation of the two rasters
  double min_significance = 4.5;  ///< σ, by which the correlation must exceed those at shifts of 5 cm
  double max_sigma_m = 0.005;     ///< m, largest standard deviation of a valid result in any direction
  double scale_sigma = 0.0;  ///< 1, σ of the motion by errors of the calibration, relative to the motion
  static FloorAlignmentOptions read(const options::Section& section);
};

/// Visual odometry from the texture of the floor around the robot. Each frame's raster (FloorRaster) is
/// aligned with that of a reference frame by robust Gauss–Newton on x, y and θ (inverse compositional: Baker
/// and Matthews, "Lucas–Kanade 20 Years On", IJCV 2004, §3.2; the gradient and Hessian of the reference are
/// computed once).
///
/// Departures from the paper, because the texture may be as weak as the noise:
/// - The step is scaled by H_× = Σ ∇R·∇Iᵀ, the product of the gradients of both rasters. Their noise is
///   independent, so H_× contains the texture alone. The reference's own Hessian also contains its noise;
///   with it the covariance would be too small on plain floor.
/// - The covariance is H_×⁻¹ S H_×⁻¹ with S = Σ g_b g_bᵀ over blocks of 16 × 16 cells, where g_b is the
///   gradient of the block b. Correlated noise of neighbouring cells is thus contained (cluster-robust
///   covariance: Liang and Zeger, Biometrika 1986).
/// - A result is valid only if its correlation exceeds that at each of six shifts of 5 cm, by a paired test
///   over the blocks. Noise and repeating patterns fail this test.
/// - What is fixed in the image pulls the estimate towards zero motion. FloorRaster subtracts most of it.
///   The rest is measured as the correlation at zero motion while the robot is more than 5 cm away from the
///   reference. Its pull is added to the covariance.
class FloorAlignment {
 public:
  /// Throws options::Error if no cell shows floor.
  FloorAlignment(const lens::Camera& camera, const FloorView& view, const FloorAlignmentOptions& options);

  struct Result {
    bool valid = false;
    TimeNs since_ns = 0;  ///< time of the reference
    Pose2 reference_from_current;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< right perturbation; m, rad
    double correlation = 0.0;                              ///< normalised, −1 to 1
    double significance = 0.0;  ///< σ, difference to the best correlation at a shift of 5 cm
    int cells = 0;              ///< compared
  };

  /// @param image CV_8UC1, or CV_8UC3 (BGR) @param objects not 0 where a pixel is not floor; empty: none
  /// @param predicted previous_from_current by the wheels. Without it, the last motion is continued, and a
  /// coarse search of ±16 cm and ±0.3 rad follows if that fails.
  /// @return valid until the next call
  const Result& add(TimeNs time, const cv::Mat& image, const cv::Mat1b& objects,
                    const std::optional<Pose2>& predicted);
  /// Drops the reference, e.g. after a gap. What is known about the image's fixed pattern is kept.
  void forget();

 private:
  /// Sums over the compared cells of one pass. `w` are the robust weights.
  struct Sums {
    Eigen::Vector3d gradient = Eigen::Vector3d::Zero();   ///< Σ w J r
    Eigen::Matrix3d hessian = Eigen::Matrix3d::Zero();    ///< Σ w J J_curᵀ, symmetric part
    double current2 = 0.0, reference2 = 0.0, both = 0.0;  ///< Σ w I², Σ w R², Σ w I R
    double weight = 0.0, cells = 0.0, magnitude = 0.0;    ///< Σ w, number, Σ |r|

    double gain() const { return reference2 > 0.0 ? both / reference2 : 0.0; }
    double correlation() const;
  };
  struct Estimate {
    bool converged = false;
    Pose2 pose;  ///< reference_from_current, in cells
    double significance = 0.0;
  };

  void takeReference(TimeNs time);
  void takeBlock(int x, int y, FloorBlock& block);
  Pose2 predictedPose(TimeNs time, const std::optional<Pose2>& predicted) const;
  void compare(const Pose2& pose, int subsets, float gain, float sigma, Sums& sums);
  void correlateAt(const Pose2& pose, std::vector<float>& correlations) const;
  Estimate align(const Pose2& start);
  double significanceOf(const Pose2& pose);
  Estimate search();
  void turnCoarse(const Pose2& pose);
  bool measure(const Estimate& estimate, const Pose2& start, bool has_prediction);
  bool findCovariance(Eigen::Matrix3d& covariance) const;
  void addPull(const Pose2& pose, const Pose2& start, bool has_prediction, Eigen::Matrix3d& covariance) const;
  Eigen::Matrix3d inCurrentFrame(const Eigen::Matrix3d& covariance, const Pose2& pose) const;
  void updateFixed(const Pose2& pose);
  double middleOfAnnulus() const { return 0.5 * (options_.inner_m + options_.outer_m) / options_.cell_m; }
  double movedCells(const Pose2& pose) const;
  void follow(TimeNs time, const Pose2& predicted, bool has_prediction);
  Pose2 toCells(const Pose2& pose) const;
  Pose2 toMetres(const Pose2& pose) const;

  FloorAlignmentOptions options_;
  FloorRaster raster_;
  // reference
  bool has_reference_ = false;
  TimeNs reference_ns_ = 0;
  float reference_contrast_ = 1.0f;
  std::vector<FloorBlock> blocks_;
  std::size_t used_blocks_ = 0;
  Eigen::Matrix3d hessian_ = Eigen::Matrix3d::Zero();
  double hessian_cells_ = 1.0;
  cv::Mat1f coarse_reference_, coarse_, coarse_turned_;
  // state
  TimeNs last_ns_ = 0;
  Pose2 reference_from_last_, last_;  ///< in cells
  Pose2 motion_;                      ///< between the last two frames
  double motion_s_ = 0.0;
  int failures_ = 0;
  bool is_tracked_ = false;  ///< the last frame's alignment converged and is significant
  double fixed_energy_ = 0.0, fixed_weight_ = 0.0;  ///< of the fixed pattern: mean square per cell; frames
  // buffers
  std::vector<FloorBlockScore> scores_;
  Sums last_sums_;
  std::vector<float> at_optimum_, shifted_;
  Result result_;
};

}  // namespace omnifleet::ground
