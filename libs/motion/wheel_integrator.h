#pragma once

#include <cstddef>
#include <deque>

#include "motion/wheeled_model.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::motion {

/// Wheel rows in, motion between frames out (Choi et al. 2014 eq. 1, integrated exactly). A row's speeds hold
/// until the next row.
class WheelIntegrator {
 public:
  struct Options {
    Integration integration = Integration::kArc;  ///< arc | euler (the paper's literal eq. 1)
    double noise = 0.02;             ///< 1, σ of a row's speed relative to it, independent per row and wheel
    double noise_floor_mps = 0.001;  ///< m/s, σ of a row's speed at standstill
    double scale_sigma = 0.0;   ///< 1, σ of each wheel's lasting scale error; 0 where an estimator knows it
    double side_slip = 0.005;   ///< 1, σ of the sideways slip per metre rolled
    double overdue_s = 0.25;    ///< s, a row older than this is late: its speed gets uncertain …
    double overdue_mps2 = 0.5;  ///< m/s², … by this much per second
    double hold_limit_s = 1.0;  ///< s, a row older than this says nothing: no motion across such a gap

    static Options read(const options::Section& section);
  };

  WheelIntegrator() = default;  ///< a robot without wheels: every motion is invalid
  /// Throws std::runtime_error unless the separation is positive.
  WheelIntegrator(double wheel_separation_m, const Options& options);

  /// A row. False, and nothing taken, where a number is not finite or the time not after the latest row's.
  bool add(TimeNs time_ns, double left_mps, double right_mps);

  /// The motion since the frame before, for the frame at `time_ns`; rows after that time stay for the next
  /// call. Invalid on the first frame, where the time does not advance, and where some part of the interval
  /// has no row in force (before the first row, or `hold_limit_s` after the latest). Covariance of the right
  /// perturbation.
  Motion motionTo(TimeNs time_ns);

  /// Forget the frame before: the next motion is invalid (a gap in the frames).
  void restart() { has_frame_ = false; }

 private:
  struct Row {
    TimeNs time_ns;
    WheelSpeeds speeds;
  };
  struct Sums;
  void roll(const Row& row, TimeNs from_ns, TimeNs to_ns, Sums& sums) const;
  bool covers(TimeNs from_ns, TimeNs to_ns) const;
  void forgetBefore(TimeNs time_ns);

  double wheel_separation_m_ = 0.0;
  Options options_;
  std::deque<Row> rows_;  ///< the row in force at the latest frame, and all after it
  bool has_frame_ = false;
  TimeNs frame_ns_ = 0;
};

}  // namespace omnifleet::motion
