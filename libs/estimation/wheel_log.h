#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <deque>

#include "geometry/pose2.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::estimation {

/// What is estimated of a robot's wheels: relative errors of the left wheel, the right wheel and the turn
/// (the separation), by how many seconds the motion lags the log, and by how many radians the way that it
/// drives leaves base_link's x axis to the left (an axle never stands exactly across it). True = measured ·
/// (1 + error).
using WheelModel = Eigen::Matrix<double, 5, 1>;
inline constexpr Eigen::Index kDelay = 3;  ///< row of the lag
using WheelJacobian = Eigen::Matrix<double, 3, 5>;

/// How a log of wheel speeds errs beyond its WheelModel. Real bases err most while they turn; at standstill
/// next to nothing.
struct WheelLogOptions {
  double scale_sigma = 0.05;        ///< 1, prior of each wheel's relative error
  double turn_sigma = 0.10;         ///< 1, prior of the turn's relative error
  double delay_sigma_s = 0.15;      ///< s, prior of the lag
  double crab_sigma_rad = 0.01;     ///< rad, prior of the angle between the way and the x axis
  double way_walk = 0.008;          ///< m/√s, random walk of the way while driving
  double way_walk_turning = 0.1;    ///< m/√s per rad/s of turning, added to it
  double side_walk = 0.004;         ///< m/√s, sideways
  double turn_walk = 0.013;         ///< rad/√s, random walk of the heading while driving
  double turn_walk_turning = 0.13;  ///< rad/√s per rad/s of turning
  double hold_limit_s = 2.0;        ///< s, a row holds so long; no motion across a longer gap

  static WheelLogOptions read(const options::Section& section);
};

/// Wheel speeds as they were logged, integrated between any two times with a given model (Choi et al. 2014
/// eq. 1, exactly along arcs), with derivatives by the model. A row's speeds hold until the next row.
class WheelLog {
 public:
  explicit WheelLog(const WheelLogOptions& options) : options_(options) {}

  /// False, and nothing taken, where a number is not finite or the time not after the latest row's.
  bool add(TimeNs time_ns, double left_mps, double right_mps);
  bool empty() const { return rows_.empty(); }
  TimeNs firstTime() const { return rows_.front().time_ns; }  ///< of a log that is not empty

  struct Motion {
    Pose2 previous_from_current;
    Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  ///< right perturbation
    WheelJacobian jacobian = WheelJacobian::Zero();        ///< increment in the end frame by the model
  };
  /// False where some part of the interval has no row in force. The motion is no straight line in the delay:
  /// what a robot did half a second ago says nothing of what it does now. So it is linearised over all delays
  /// that `delay_sigma_s` leaves (statistical linear regression by Gauss–Hermite points, Särkkä 2013, §5.4),
  /// and what no line through them says goes into the covariance.
  bool between(TimeNs from_ns, TimeNs to_ns, double wheel_separation_m, const WheelModel& model,
               double delay_sigma_s, Motion& motion) const;

  /// Rows that end before this time are needed no more.
  void forgetBefore(TimeNs time_ns);

 private:
  struct Row {
    TimeNs time_ns;
    double left_mps, right_mps;
  };
  Pose2 integrate(TimeNs from_ns, TimeNs to_ns, double wheel_separation_m, const WheelModel& model,
                  Eigen::Matrix3d* covariance) const;
  bool covers(TimeNs from_ns, TimeNs to_ns) const;
  std::size_t rowAt(TimeNs time_ns) const;

  WheelLogOptions options_;
  std::deque<Row> rows_;
};

}  // namespace omnifleet::estimation
