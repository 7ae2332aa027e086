#pragma once

#include <Eigen/Core>
#include <cmath>

#include "options/options.h"
#include "tracking/view.h"

namespace omnifleet::tracking {

struct PrismFilterOptions {
  double radius_m = 0.15;        ///< m, expected mean radius of an object not seen before
  double radius_sigma_m = 0.10;  ///< m
  double roundness_sigma_m =
      0.03;                   ///< m, expected size of the second to fourth harmonic of a footprint's support
  double height_ratio = 0.5;  ///< height ÷ camera height of an object not seen before
  double height_ratio_sigma = 0.25;  ///< 1
  double model_sigma_m = 0.008;    ///< m on the floor, what the model leaves out (sharp corners, calibration)
  double correlation = 4.0;        ///< variance factor: neighbouring directions share supporting points
  double acceleration_mps2 = 0.6;  ///< m/s², of what moves
  double still_acceleration_mps2 = 0.02;  ///< m/s², of what stands
  double outlier = 3.0;                   ///< σ beyond which a direction is weighed down

  static PrismFilterOptions read(const options::Section& section);
};

/// One object as an upright prism in `odom`, estimated jointly from every view of it: position and velocity
/// of the footprint's centre (Steiner point), and its shape: mean radius ρ, harmonics α_m, β_m (m = 2, 3, 4)
/// of the footprint's support function and u = (H − h)/H = 1/s. With g the support relative to the camera
/// foot c
///   h_P(n) = ρ + Σ_m α_m cos mφ + β_m sin mφ + n·p,
///   b < 0 (contact side):  b + n·c = h_P(n)           b ≥ 0 (far side):  u·b + n·c = h_P(n)
/// (docs/methods.md, "Support-function prism"), both linear in the state given b: a Kalman filter without
/// linearisation. Height comes from parallax between views and from the expectation that things are about as
/// deep as wide; cut directions simply carry no information.
class PrismFilter {
 public:
  static constexpr int kStates = 12;  ///< x, y, vx, vy, ρ, u, α2, β2, α3, β3, α4, β4
  using State = Eigen::Matrix<double, kStates, 1>;
  using Covariance = Eigen::Matrix<double, kStates, kStates>;

  /// From a first view; `guess_m` in odom.
  PrismFilter(const PrismFilterOptions& options, const Eigen::Vector2d& guess_m, double camera_height_m);

  /// Constant velocity over dt; what stands is held. `own_noise` is the covariance of the object's place
  /// relative to the camera that the own step added (odom axes).
  void predict(double dt_s, bool moving, bool visible, const Eigen::Matrix2d& own_noise);
  /// Everything is still there but nobody knows how far the robot went meanwhile.
  void predictAcrossGap(double sigma_m);
  /// Takes in the usable directions of one view.
  /// Returns the share of directions that did not agree with what was known.
  double update(const View& view);
  /// Height measured otherwise (from the vectors' lengths).
  void updateHeight(double height_m, double sigma_m);
  /// Place told otherwise.
  void updatePosition(const Eigen::Vector2d& position_m, const Eigen::Matrix2d& covariance);
  /// Fixes the shape to a known body's; the harmonics stay free where it is not round, as it may turn.
  /// Position and velocity stay, a little loosened.
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

  /// Support function that the camera of `view` should see (relative to its foot), direction k.
  double predictedSupport(const View& view, std::size_t k) const {
    return predictedSupport(view.foot_m, view.angle(k));
  }
  /// Likewise from `foot_m`, in a direction of odom.
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
