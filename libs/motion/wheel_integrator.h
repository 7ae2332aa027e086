#pragma once

#include <cstddef>
#include <deque>

#include "motion/wheeled_model.h"
#include "observation/observation.h"
#include "options/options.h"

namespace omnifleet::motion {

/// Integrates rows of wheel speeds into the motion between frames (Choi et al. 2014 eq. 1, integrated
/// exactly). The speeds of a row hold until the next row.
class WheelIntegrator {
 public:
  struct Options {
    bool use = true;                              ///< false: as a robot without wheels
    Integration integration = Integration::kArc;  ///< arc | euler (the paper's literal eq. 1)
    double noise = 0.02;  ///< 1, σ of a row's speed relative to that speed, independent per row and wheel
    double noise_floor_mps = 0.001;  ///< m/s, σ of a row's speed at standstill
    double scale_sigma =
        0.0;  ///< 1, σ of each wheel's constant scale error; 0 if an estimator estimates the scale
    double side_slip = 0.005;   ///< 1, σ of the sideways slip per metre rolled
    double overdue_s = 0.25;    ///< s, age of a row beyond which its speed becomes uncertain
    double overdue_mps2 = 0.5;  ///< m/s², σ of the speed per second of age beyond `overdue_s`
    double hold_limit_s = 1.0;  ///< s, age of a row beyond which it is not used: no motion across such a gap

    static Options read(const options::Section& section);
  };

  WheelIntegrator() = default;  ///< robot without wheels: every motion is invalid
  /// Throws std::runtime_error unless the separation is positive.
  WheelIntegrator(double wheel_separation_m, const Options& options);

  /// Adds a row. Returns false and ignores the row if a number is not finite or its time is not after the
  /// latest row's.
  bool add(TimeNs time_ns, double left_mps, double right_mps);

  /// Motion from the previous frame to the frame at `time_ns`. Rows after that time are kept for the next
  /// call. Invalid on the first frame, if the time does not advance, and if part of the interval has no row
  /// in force (before the first row, or more than `hold_limit_s` after the latest). The covariance is that of
  /// the right perturbation.
  Motion motionTo(TimeNs time_ns);

  /// False for a robot without wheels, and if the options say not to use them.
  bool isInUse() const { return wheel_separation_m_ > 0.0; }

  /// Forgets the previous frame: the next motion is invalid (gap in the frames).
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
  std::deque<Row> rows_;  ///< the row in force at the latest frame, and all later rows
  bool has_frame_ = false;
  TimeNs frame_ns_ = 0;
};

}  // namespace omnifleet::motion
