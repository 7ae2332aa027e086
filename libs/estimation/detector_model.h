#pragma once

#include <Eigen/Core>

#include "options/options.h"

namespace omnifleet::estimation {

/// How a detector of ranges and bearings errs: (bearing bias β₀ rad, focal error ε, range scale k,
/// obliqueness κ, its axis α rad, lag τ s, place x₀, y₀ m). It stands at (x₀, y₀) in base_link and tells what
/// was there τ before the time it gives; a target at true range r and bearing β from there is measured at
///   range r·(1 + k − κ·(1 − cos(β − α))),  bearing β + β₀ + ε·½·sin 2β.
/// κ = 1 where the "range" is the depth along the camera's axis, as from the height of a marker in a picture;
/// that axis is base_link's x axis about as exactly as the camera was mounted. ε is first order in the focal
/// length's relative error, tan β′ = (1 + ε)·tan β. The lag is told from that of the wheels by its prior
/// alone: what is uncertain of it stays in the covariance of the poses; likewise the heading of base_link
/// from β₀ and the way that the wheels drive.
using DetectorModel = Eigen::Matrix<double, 8, 1>;

/// Where that stands which was measured, in base_link at the time given, of a base that moves so (m/s, m/s,
/// rad/s); by fixed-point iteration, first order in the lag.
Eigen::Vector2d seenAt(const Eigen::Vector2d& range_bearing, const DetectorModel& model,
                       const Eigen::Vector3d& twist = Eigen::Vector3d::Zero());

/// Priors of what is estimated of a detector of ranges and bearings (DetectorModel).
struct DetectorOptions {
  double bearing_bias_sigma_rad = 0.04;  ///< rad, of how it is mounted
  double focal_sigma = 0.03;             ///< 1, relative error of its focal length
  double range_scale_sigma = 0.04;       ///< 1
  double obliqueness_sigma = 0.8;        ///< 1: 0 measures range, 1 depth along the axis
  double axis_sigma_rad = 0.04;          ///< rad, of that axis
  double lag_sigma_s = 0.05;             ///< s, by which what it tells is older than it says
  double place_sigma_m = 0.03;           ///< m, each axis, of where it stands in base_link

  static DetectorOptions read(const options::Section& section);
};

}  // namespace omnifleet::estimation
