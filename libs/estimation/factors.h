#pragma once

// Residuals of the fleet graph that are not silhouettes. Poses are (x, y, θ) in map, θ not wrapped; a
// residual is whitened by the square root of the information it is given.

#include <ceres/cost_function.h>

#include <Eigen/Core>
#include <memory>
#include <vector>

#include "estimation/detector_model.h"
#include "estimation/wheel_log.h"
#include "geometry/pose2.h"

namespace omnifleet::estimation {

/// S·(x − x₀) + r₀ over several variables: what marginalised factors leave behind, and simple priors.
class DensePrior : public ceres::CostFunction {
 public:
  DensePrior(Eigen::MatrixXd s, Eigen::VectorXd r0, std::vector<Eigen::VectorXd> at);
  bool Evaluate(double const* const* parameters, double* residuals, double** jacobians) const override;

  const Eigen::MatrixXd& s() const { return s_; }
  const std::vector<Eigen::VectorXd>& at() const { return at_; }
  /// The same residual at other values, and from there on with another S.
  void relinearise(std::vector<Eigen::VectorXd> at, Eigen::MatrixXd s);

 private:
  Eigen::VectorXd change(const double* const* parameters) const;
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

/// A range and bearing: where the observer stands at its time, and how it moves (per second, base_link).
struct RangeBearingSight {
  Eigen::Vector2d range_bearing;
  Eigen::Matrix2d covariance;
  Pose2 from_offset;  ///< of the observer from its pose variable
  Eigen::Vector3d twist = Eigen::Vector3d::Zero();
};
/// Of another robot, which is taken to stand still for the lag. Variables: from, target, detector.
std::unique_ptr<ceres::CostFunction> rangeBearingPoseFactor(const RangeBearingSight& sight,
                                                            const Pose2& to_offset);
/// Of a point. Variables: from, point (x, y), detector.
std::unique_ptr<ceres::CostFunction> rangeBearingPointFactor(const RangeBearingSight& sight);

/// A place in an observer's base_link, each axis as exact as `sigma_m`, where a point stands. Variables:
/// observer, point (x, y).
std::unique_ptr<ceres::CostFunction> pointInBaseFactor(const Eigen::Vector2d& in_base, double sigma_m);
/// Likewise, where the place `in_other` of another's base_link lies. Variables: observer, other.
std::unique_ptr<ceres::CostFunction> placeInBaseFactor(const Eigen::Vector2d& in_base, double sigma_m,
                                                       const Eigen::Vector2d& in_other);

/// Arc of a differential drive (Choi et al. 2014 eq. 1, integrated exactly over the step).
Pose2 arc(double left_m, double right_m, double wheel_separation_m);
/// Increment in the arc's end frame per relative error of each wheel.
Eigen::Matrix<double, 3, 2> arcBiasJacobian(double left_m, double right_m, double wheel_separation_m);

}  // namespace omnifleet::estimation
