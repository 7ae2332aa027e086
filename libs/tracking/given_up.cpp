#include "tracking/given_up.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::tracking {
namespace {

constexpr double kStands_s = 60.0;
constexpr double kDriving_mps = 0.05;  // of what goes on behind something …
constexpr double kFaster = 1.5;        // … at no more than so many times its speed …
constexpr double kBeyond_m = 0.2;      // … and comes out no farther than this beyond it,
constexpr double kAlikeSigmas = 2.0;   // as wide and high as it was,
constexpr double kAlike_m = 0.01;      // which the prism leaves uncertain by this

bool alike(double a, double sigma_a, double b, double sigma_b) {
  return std::abs(a - b) < kAlikeSigmas * (std::hypot(sigma_a, sigma_b) + kAlike_m);
}

}  // namespace

double wayOn(const PrismFilter& thing, const Eigen::Vector2d& place_m, double speed_mps, double unseen_s,
             const PrismFilter& seen) {
  if (speed_mps < kDriving_mps ||
      !alike(thing.radius(), thing.radiusSigma(), seen.radius(), seen.radiusSigma()) ||
      !alike(thing.height(), thing.heightSigma(), seen.height(), seen.heightSigma()))
    return INFINITY;
  return (place_m - seen.position()).norm() / (kFaster * speed_mps * unseen_s + kBeyond_m);
}

void GivenUp::add(const TrackState& track) {
  if (track.identity >= 0) return;
  if (entries_.size() >= kMost) entries_.erase(entries_.begin());
  entries_.push_back({track.id, track.evidence, track.kind, track.kind_probability, track.filter,
                      track.last_seen_m, track.last_speed_mps, track.seen_ns,
                      track.kind == ObjectKind::kObstacle && !track.moving});
}

std::optional<GivenUp::Entry> GivenUp::take(const PrismFilter& seen, double gate_m, TimeNs now_ns,
                                            double keep_s) {
  std::size_t nearest = entries_.size();
  double least = 1.0;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Entry& entry = entries_[i];
    const double unseen_s = static_cast<double>(now_ns - entry.seen_ns) * 1e-9;
    const double apart = (entry.place_m - seen.position()).norm() / gate_m;
    const double distance =
        std::min(apart, wayOn(entry.filter, entry.place_m, entry.speed_mps, unseen_s, seen));
    if (distance >= least || unseen_s > (entry.stood ? kStands_s : keep_s)) continue;
    least = distance;
    nearest = i;
  }
  if (nearest == entries_.size()) return std::nullopt;
  const Entry entry = entries_[nearest];
  entries_.erase(entries_.begin() + static_cast<std::ptrdiff_t>(nearest));
  return entry;
}

}  // namespace omnifleet::tracking
