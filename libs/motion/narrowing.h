#pragma once

#include "motion/avoidance.h"
#include "motion/formation_law.h"
#include "motion/trail.h"

namespace omnifleet::motion {

/// A follower's place where the passage is narrow: drawn in from the commanded place towards the trail of the
/// robot it follows, no further than what stands about asks for. Drawn in, ranks queue one behind the other,
/// so that both sides may draw in at once. Nobody draws in for what lies beyond the goal; to spread out again
/// takes room on the whole way looked at, for a thing hides what stands behind it. Every follower decides by
/// its own camera; nobody has to agree.
class Narrowing {
 public:
  struct Options {
    bool enabled = true;
    double margin_m = 0.16;   ///< m, free about the body at the place kept
    double ahead_m = 0.6;     ///< m, the way that the place will take next is looked at so far, or to its end
    double queue_m = 0.60;    ///< m, between ranks that queue on one trail
    double in_per_s = 1.0;    ///< 1/s, drawing in
    double out_per_s = 0.35;  ///< 1/s, spreading out again
    double settle_m = 0.04;   ///< m, more room than margin_m is wanted before spreading out

    static Options read(const options::Section& section);
  };

  explicit Narrowing(const Options& options) : options_(options) {}

  /// Decides for this frame. `rank`: of the follower. Returns 0 (as commanded) … 1 (on the trail).
  double update(const Slot& slot, std::size_t rank, const Followed& followed, const Trail& trail,
                const Surroundings& around, double dt_s);
  /// Place and its velocity for the narrowing decided.
  Place place(const Slot& slot, std::size_t rank, const Followed& followed, const Trail& trail,
              const FollowLaw& law) const;
  /// Length of the queue between a rank and the one it follows.
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
