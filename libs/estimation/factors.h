#pragma once

// Residuals of the fleet graph that are not silhouettes. Poses are (x, y, θ) in map, θ not wrapped; a
// residual is whitened by the square root of the information it is given.

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "estimation/wheel_log.h"
#include "geometry/pose2.h"

namespace omnifleet::estimation {

/// S·(x − x₀) + r₀ over several variables: what marginalised factors leave behind, and simple priors.
class DensePrior : public ceres::CostFunction {
 public:
  DensePrior(Eigen::MatrixXd s, Eigen::VectorXd r0, std::vector<Eigen::VectorXd> at);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

 private:
  Eigen::MatrixXd s_;
  Eigen::VectorXd r0_;
  std::vector<Eigen::VectorXd> at_;
};

/// (x − value) / σ, component by component.
std::unique_ptr<ceres::CostFunction> priorFactor(const Eigen::VectorXd& value, const Eigen::VectorXd& sigma);

/// Pose (or, with `offset`, pose ∘ offset) against a measured one; covariance of the right perturbation.
/// Variables: pose.
std::unique_ptr<ceres::CostFunction> absolutePoseFactor(const Pose2& measured,
                                                        const Eigen::Matrix3d& covariance,
                                                        const Pose2& offset = {});

/// x, y of pose ∘ offset (or of a point, see pointPrior) against a measured position in map.
std::unique_ptr<ceres::CostFunction> absolutePositionFactor(const Eigen::Vector2d& measured,
                                                            const Eigen::Matrix2d& covariance,
                                                            const Pose2& offset = {});

/// (from ∘ from_offset)⁻¹ · (to ∘ to_offset) against a measured relative pose. Variables: from, to.
std::unique_ptr<ceres::CostFunction> relativePoseFactor(const Pose2& measured,
                                                        const Eigen::Matrix3d& covariance,
                                                        const Pose2& from_offset = {},
                                                        const Pose2& to_offset = {});

/// Motion between two frames of one robot whose wheels err by the model e: the motion measured with the model
/// `at` is followed by the increment B·(e − at) in its end frame. Variables: previous pose, current pose,
/// wheel model.
std::unique_ptr<ceres::CostFunction> motionFactor(const Pose2& measured, const Eigen::Matrix3d& covariance,
                                                  const WheelJacobian& by_model,
                                                  const WheelModel& at = WheelModel::Zero());

/// How a detector of ranges and bearings errs: (bearing bias β₀ rad, focal error ε, range scale k,
/// obliqueness κ). A target at true range r and bearing β is measured at
///   range r·(1 + k − κ·(1 − cos β)),  bearing β + β₀ + ε·½·sin 2β.
/// κ = 1 where the "range" is the depth along the camera's axis, as from the height of a marker in a picture;
/// ε is first order in the focal length's relative error, tan β′ = (1 + ε)·tan β.
using DetectorModel = Eigen::Vector4d;

/// True range and bearing of what was measured, by fixed-point iteration.
Eigen::Vector2d corrected(const Eigen::Vector2d& range_bearing, const DetectorModel& model);

/// Range and bearing of a target from a pose. Variables: from, target (pose, its x and y count), detector.
std::unique_ptr<ceres::CostFunction> rangeBearingPoseFactor(const Eigen::Vector2d& range_bearing,
                                                            const Eigen::Matrix2d& covariance,
                                                            const Pose2& from_offset, const Pose2& to_offset);
/// The same to a point. Variables: from, point (x, y), detector.
std::unique_ptr<ceres::CostFunction> rangeBearingPointFactor(const Eigen::Vector2d& range_bearing,
                                                             const Eigen::Matrix2d& covariance,
                                                             const Pose2& from_offset);

/// Arc of a differential drive (Choi et al. 2014 eq. 1, integrated exactly over the step).
Pose2 arc(double left_m, double right_m, double wheel_separation_m);
/// Increment in the arc's end frame per relative error of each wheel.
Eigen::Matrix<double, 3, 2> arcBiasJacobian(double left_m, double right_m, double wheel_separation_m);

}  // namespace omnifleet::estimation
