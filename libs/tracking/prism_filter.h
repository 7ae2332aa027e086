#pragma once

#include <Eigen/Core>
#include <cmath>

#include "options/options.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

struct PrismFilterOptions {
  double radius_m = 0.15;            ///< m, expected mean radius of an object not seen before
  double radius_sigma_m = 0.10;      ///< m
  double roundness_sigma_m = 0.03;   ///< m, σ of the second to fourth harmonic of a footprint's support
  double height_ratio = 0.5;         ///< height ÷ camera height of an object not seen before
  double height_ratio_sigma = 0.25;  ///< 1
  double model_sigma_m = 0.008;      ///< m on the floor, model error (sharp corners, calibration)
  double correlation = 4.0;          ///< variance factor: neighbouring directions share supporting points
  double acceleration_mps2 = 0.6;    ///< m/s², of a moving object
  double still_acceleration_mps2 = 0.02;  ///< m/s², of a stationary object
  double outlier = 3.0;                   ///< σ beyond which a direction is down-weighted

  static PrismFilterOptions read(const options::Section& section);
};

/// One object as an upright prism in `odom`, estimated jointly from all its views. The state holds position
/// and velocity of the footprint's centre (Steiner point) and the shape: mean radius ρ, harmonics α_m, β_m (m
/// = 2, 3, 4) of the footprint's support function, and u = (H − h)/H = 1/s. With b the observed support
/// relative to the camera foot c:
/// h_P(n) = ρ + Σ_m α_m cos mφ + β_m sin mφ + n·p,
/// b < 0 (contact side): b + n·c = h_P(n),
/// b ≥ 0 (far side): u·b + n·c = h_P(n)
/// (docs/methods/local_mapper.md). Both equations are linear in the state given b: a Kalman filter without
/// linearization. The height comes from the parallax between views and from the prior that objects are about
/// as deep as wide. Cut directions carry no information.
class PrismFilter {
 public:
  static constexpr int kStates = 12;  ///< x, y, vx, vy, ρ, u, α2, β2, α3, β3, α4, β4
  using State = Eigen::Matrix<double, kStates, 1>;
  using Covariance = Eigen::Matrix<double, kStates, kStates>;

  /// Starts from a first view; `guess_m` in odom.
  PrismFilter(const PrismFilterOptions& options, const Eigen::Vector2d& guess_m, double camera_height_m);

  /// Constant velocity over `dt_s`. The velocity of a stationary object decays. `own_noise` is the covariance
  /// that the own step adds to the object's place relative to the camera (odom axes).
  void predict(double dt_s, bool moving, bool visible, const Eigen::Matrix2d& own_noise);
  /// The objects stay, but the robot's displacement during the gap is unknown: adds `sigma_m` to the
  /// position.
  void predictAcrossGap(double sigma_m);
  /// Adds the usable directions of one view. Returns the share of directions that were outliers against the
  /// prediction.
  double update(const View& view);
  /// Adds a height that the vectors' lengths measured.
  void updateHeight(double height_m, double sigma_m);
  /// Adds a position from another source, e.g. a published pose.
  void updatePosition(const Eigen::Vector2d& position_m, const Eigen::Matrix2d& covariance);
  /// Fixes the shape to that of a known body. The harmonics stay free where the body is not round, because it
  /// may turn. Position and velocity stay; the position covariance is enlarged.
  void assumeBody(double mean_radius_m, double height_m, bool round);
  void forgetShape();
  void placeAt(const Eigen::Vector2d& position_m, const Eigen::Vector2d& velocity_mps,
               const Eigen::Matrix2d& covariance);

  Eigen::Vector2d position() const { return state_.head<2>(); }
  Eigen::Vector2d velocity() const { return state_.segment<2>(2); }
  Eigen::Matrix2d positionCovariance() const { return covariance_.topLeftCorner<2, 2>(); }
  double radius() const { return state_[4]; }
  /// Support of the footprint about its centre in a direction of odom, metres.
  double reach(double angle_rad) const;
  double radiusSigma() const { return std::sqrt(covariance_(4, 4)); }
  double height() const;       ///< metres
  double heightSigma() const;  ///< metres

  /// Predicted support relative to the camera foot of `view` in direction k.
  double predictedSupport(const View& view, std::size_t k) const {
    return predictedSupport(view.foot_m, view.angle(k));
  }
  /// Predicted support relative to `foot_m`, in a direction of odom.
  double predictedSupport(const Eigen::Vector2d& foot_m, double angle_rad) const;
  /// The footprint as a polygon in odom, counter-clockwise.
  Polygon footprint(int vertices) const;

 private:
  PrismFilterOptions options_;
  double camera_height_m_;
  State state_;
  Covariance covariance_;
};

}  // namespace omnifleet::tracking
