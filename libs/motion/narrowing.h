#pragma once

#include "motion/avoidance.h"
#include "motion/formation_law.h"
#include "motion/trail.h"

namespace omnifleet::motion {

/// Place of a follower in narrow passages: moved in from the commanded place towards the trail of the robot
/// it follows, only as far as the obstacles require. Ranks that have moved in queue one behind the other, so
/// both sides may do so at once. Obstacles beyond the goal do not narrow the formation. Spreading out again
/// requires room along the whole length that is checked, because an obstacle hides what is behind it. Every
/// follower decides from its own camera, without agreement with other robots.
class Narrowing {
 public:
  struct Options {
    bool enabled = true;
    double margin_m = 0.16;  ///< m, clearance of the body at the place kept
    double ahead_m =
        0.6;  ///< m, length of the future path of the place that is checked; less if that path ends before
    double queue_m = 0.60;    ///< m, distance between ranks that queue on one trail
    double in_per_s = 1.0;    ///< 1/s, rate of moving in
    double out_per_s = 0.35;  ///< 1/s, rate of spreading out
    double settle_m = 0.04;   ///< m, clearance beyond margin_m that is required before spreading out

    static Options read(const options::Section& section);
  };

  explicit Narrowing(const Options& options) : options_(options) {}

  /// Updates the narrowing for this frame. `rank`: rank of the follower. Returns 0 (commanded place) … 1 (on
  /// the trail).
  double update(const Slot& slot, std::size_t rank, const Followed& followed, const Trail& trail,
                const Surroundings& around, double dt_s);
  /// Place and its velocity at the current narrowing.
  Place place(const Slot& slot, std::size_t rank, const Followed& followed, const Trail& trail,
              const FollowLaw& law) const;
  /// Length of the queue between a rank and the rank it follows, metres.
  double queueLength(const Slot& slot, std::size_t rank) const;
  double narrowing() const { return narrowing_; }

 private:
  Eigen::Vector2d at(double narrowing, double ahead_m, const Slot& slot, std::size_t rank,
                     const Followed& followed, const Trail& trail) const;
  bool isFree(double narrowing, double margin_m, double most_m, const Slot& slot, std::size_t rank,
              const Followed& followed, const Trail& trail, const Surroundings& around) const;

  Options options_;
  double narrowing_ = 0.0;
};

}  // namespace omnifleet::motion
