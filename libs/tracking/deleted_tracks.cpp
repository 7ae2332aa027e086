#include "tracking/deleted_tracks.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::tracking {
namespace {

constexpr double kStands_s = 60.0;
constexpr double kDriving_mps = 0.05;  // m/s, slower objects are not expected to travel unseen
constexpr double kFaster = 1.5;        // a hidden object travels at up to this factor times its last speed
constexpr double kBeyond_m = 0.2;      // m, added to the distance that it can have travelled
constexpr double kAlikeSigmas = 2.0;   // σ, tolerance of width and height
constexpr double kAlike_m = 0.01;      // m, uncertainty of the prism model, added to σ

bool alike(double a, double sigma_a, double b, double sigma_b) {
  return std::abs(a - b) < kAlikeSigmas * (std::hypot(sigma_a, sigma_b) + kAlike_m);
}

}  // namespace

double travelRatio(const PrismFilter& object, const Eigen::Vector2d& place_m, double speed_mps,
                   double unseen_s, const PrismFilter& seen) {
  if (speed_mps < kDriving_mps ||
      !alike(object.radius(), object.radiusSigma(), seen.radius(), seen.radiusSigma()) ||
      !alike(object.height(), object.heightSigma(), seen.height(), seen.heightSigma()))
    return INFINITY;
  return (place_m - seen.position()).norm() / (kFaster * speed_mps * unseen_s + kBeyond_m);
}

void DeletedTracks::add(const TrackState& track) {
  if (track.identity >= 0) return;
  if (entries_.size() >= kMost) entries_.erase(entries_.begin());
  entries_.push_back({track.id, track.evidence, track.kind, track.kind_probability, track.filter,
                      track.last_seen_m, track.last_speed_mps, track.seen_ns,
                      track.kind == ObjectKind::kObstacle && !track.moving});
}

std::optional<DeletedTracks::Entry> DeletedTracks::take(const PrismFilter& seen, double gate_m, TimeNs now_ns,
                                                        double keep_s) {
  std::size_t nearest = entries_.size();
  double least = 1.0;
  for (std::size_t i = 0; i < entries_.size(); ++i) {
    const Entry& entry = entries_[i];
    const double unseen_s = static_cast<double>(now_ns - entry.seen_ns) * 1e-9;
    const double apart = (entry.place_m - seen.position()).norm() / gate_m;
    const double distance =
        std::min(apart, travelRatio(entry.filter, entry.place_m, entry.speed_mps, unseen_s, seen));
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
