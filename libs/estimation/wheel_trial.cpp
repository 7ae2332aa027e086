#include "estimation/wheel_trial.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "estimation/factors.h"

namespace omnifleet::estimation {
namespace {

constexpr double kStretch_m = 0.05;                // ways so long tell the readings apart
constexpr double kSigma_m = 0.02, kMost = 9.0;     // of a thing's place; χ² of what is elsewhere
constexpr double kWidth_m = 0.04, kShare = 0.3;    // how much half widths may differ
constexpr std::size_t kLeastThings = 2;            // one may move by itself
constexpr double kForget = 0.9;                    // what a stretch counts, to the one after it
constexpr double kLeastStretches = 3.4;            // four in a row, …
constexpr double kRefuted = 6.5, kBorneOut = 2.5;  // … mean χ² that contradicts, that agrees, …
constexpr double kAlike = 1.0;  // … and that distinguishes nothing: the simplest assignment counts

using Misfits = std::array<double, kWirings>;

constexpr std::size_t index(Wiring wiring) {
  return static_cast<std::size_t>(wiring);
}

Pose2 readAs(Wiring wiring, const Motion& m, double separation_m) {
  switch (wiring) {
    case Wiring::kAsConfigured:
      return m.previous_from_current;
    case Wiring::kReversed:
      return arc(-m.left_m, -m.right_m, separation_m);
    case Wiring::kSwapped:
      return arc(m.right_m, m.left_m, separation_m);
    case Wiring::kBoth:
      return arc(-m.right_m, -m.left_m, separation_m);
    case Wiring::kLeftReversed:
      return arc(-m.left_m, m.right_m, separation_m);
    case Wiring::kRightReversed:
      return arc(m.left_m, -m.right_m, separation_m);
  }
  return m.previous_from_current;
}

/// χ² of the nearest thing that it may have been.
double misfitOf(const Standing& now, const std::vector<Standing>& then, const Pose2& then_from_now) {
  double least = kMost;
  for (const Standing& was : then) {
    if (std::abs(was.half_width_m - now.half_width_m) > kWidth_m + kShare * was.half_width_m) continue;
    const double off_m = (then_from_now * now.in_base_m - was.in_base_m).norm();
    least = std::min(least, off_m * off_m / (kSigma_m * kSigma_m));
  }
  return least;
}

}  // namespace

void WheelTrial::add(const Motion& motion, double wheel_separation_m, std::vector<Standing> seen) {
  if (!motion.valid || !(wheel_separation_m > 0)) {
    begin(std::move(seen));
    return;
  }
  if (!then_.empty()) {
    for (std::size_t w = 0; w < kWirings; ++w)
      way_[w] = way_[w] * readAs(static_cast<Wiring>(w), motion, wheel_separation_m);
    rolled_m_ += 0.5 * (std::abs(motion.left_m) + std::abs(motion.right_m));
    if (rolled_m_ < kStretch_m) return;
    judge(seen);
  }
  begin(std::move(seen));
}

void WheelTrial::begin(std::vector<Standing> seen) {
  then_ = std::move(seen);
  way_.fill(Pose2{});
  rolled_m_ = 0.0;
}

/// What fits by no reading was not in sight then, or moves.
void WheelTrial::judge(const std::vector<Standing>& now) {
  Misfits sum{};
  std::size_t things = 0;
  for (const Standing& thing : now) {
    Misfits misfit;
    for (std::size_t w = 0; w < kWirings; ++w) misfit[w] = misfitOf(thing, then_, way_[w]);
    if (*std::min_element(misfit.begin(), misfit.end()) >= kMost) continue;
    for (std::size_t w = 0; w < kWirings; ++w) sum[w] += misfit[w];
    ++things;
  }
  if (things < kLeastThings) return;
  for (std::size_t w = 0; w < kWirings; ++w)
    misfit_[w] = kForget * misfit_[w] + sum[w] / static_cast<double>(things);
  stretches_ = kForget * stretches_ + 1.0;
}

Wiring WheelTrial::verdict() const {
  const double least = *std::min_element(misfit_.begin(), misfit_.end());
  if (stretches_ < kLeastStretches || misfit_[index(Wiring::kAsConfigured)] < kRefuted * stretches_ ||
      least > kBorneOut * stretches_)
    return Wiring::kAsConfigured;
  const auto simplest = std::find_if(misfit_.begin(), misfit_.end(),
                                     [&](double misfit) { return misfit < least + kAlike * stretches_; });
  return static_cast<Wiring>(simplest - misfit_.begin());
}

}  // namespace omnifleet::estimation
