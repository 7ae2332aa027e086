#include "motion/narrowing.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::motion {
namespace {

constexpr int kSteps = 10;  // number of narrowings tried
constexpr double kSampleSpacingM = 0.15;
constexpr double kQueueFirst =
    2.0;  // queueing is complete at half narrowing: only then do the two sides come close

}  // namespace

Narrowing::Options Narrowing::Options::read(const options::Section& section) {
  Options options;
  section.read("enabled", options.enabled);
  section.read("margin_m", options.margin_m, {0.0, 2.0});
  section.read("ahead_m", options.ahead_m, {0.0, 5.0});
  section.read("queue_m", options.queue_m, {0.1, 10.0});
  section.read("in_per_s", options.in_per_s, {0.01, 100.0});
  section.read("out_per_s", options.out_per_s, {0.01, 100.0});
  section.read("settle_m", options.settle_m, {0.0, 1.0});
  section.finish();
  return options;
}

double Narrowing::queueLength(const Slot& slot, std::size_t rank) const {
  if (isQueue(slot)) return slot.distance_m;
  return std::max(slot.distance_m * std::cos(slot.angle_rad),
                  options_.queue_m * static_cast<double>(rank - slot.followed));
}

Eigen::Vector2d Narrowing::at(double narrowing, double ahead_m, const Slot& slot, std::size_t rank,
                              const Followed& followed, const Trail& trail) const {
  const double commanded_m = slot.distance_m * std::cos(slot.angle_rad);
  const double share = std::min(1.0, kQueueFirst * narrowing);
  const double back_m = commanded_m + share * (queueLength(slot, rank) - commanded_m) - ahead_m;
  const double aside_m = -slot.distance_m * std::sin(slot.angle_rad);
  const Eigen::Vector2d ahead(std::cos(followed.heading_rad), std::sin(followed.heading_rad));
  const Eigen::Vector2d stiff_m =
      followed.position_m - back_m * ahead + aside_m * Eigen::Vector2d(-ahead.y(), ahead.x());
  if (narrowing <= 0.0) return stiff_m;
  const Eigen::Vector2d trail_m = back_m > 0.0 ? trail.at(back_m, followed.heading_rad).place_m
                                               : Eigen::Vector2d(followed.position_m - back_m * ahead);
  return (1.0 - narrowing) * stiff_m + narrowing * trail_m;
}

bool Narrowing::isFree(double narrowing, double margin_m, double most_m, const Slot& slot, std::size_t rank,
                       const Followed& followed, const Trail& trail, const Surroundings& around) const {
  const double least_m = around.radius_m + margin_m;
  const int samples = static_cast<int>(std::ceil(most_m / kSampleSpacingM));
  for (int sample = 0; sample <= samples; ++sample) {
    const double ahead_m = std::min(sample * kSampleSpacingM, most_m);
    const Eigen::Vector2d place_m = at(narrowing, ahead_m, slot, rank, followed, trail);
    for (const Eigen::Vector2d& point_m : around.points_m) {
      if ((point_m - place_m).squaredNorm() < least_m * least_m) return false;
    }
  }
  return true;
}

double Narrowing::update(const Slot& slot, std::size_t rank, const Followed& followed, const Trail& trail,
                         const Surroundings& around, double dt_s) {
  if (isQueue(slot)) return narrowing_ = 1.0;
  if (!options_.enabled) return narrowing_ = 0.0;
  double wanted = 1.0;
  for (int step = 0; step < kSteps; ++step) {
    const double tried = static_cast<double>(step) / kSteps;
    const bool spread = tried < narrowing_;
    const double margin_m = options_.margin_m + (spread ? options_.settle_m : 0.0);
    const double ahead_m = spread ? options_.ahead_m : std::min(options_.ahead_m, followed.remaining_m);
    if (!isFree(tried, margin_m, ahead_m, slot, rank, followed, trail, around)) continue;
    wanted = tried;
    break;
  }
  narrowing_ =
      std::clamp(wanted, narrowing_ - options_.out_per_s * dt_s, narrowing_ + options_.in_per_s * dt_s);
  return narrowing_;
}

Place Narrowing::place(const Slot& slot, std::size_t rank, const Followed& followed, const Trail& trail,
                       const FollowLaw& law) const {
  Place place = law.place(slot, followed);
  if (narrowing_ <= 0.0) return place;
  place.position_m = at(narrowing_, 0.0, slot, rank, followed, trail);
  const Trail::Spot spot = trail.at(queueLength(slot, rank), followed.heading_rad);
  place.velocity_mps =
      (1.0 - narrowing_) * place.velocity_mps + narrowing_ * followed.twist.forward_mps * spot.ahead;
  place.heading_rad += narrowing_ * wrapAngle(std::atan2(spot.ahead.y(), spot.ahead.x()) - place.heading_rad);
  return place;
}

}  // namespace omnifleet::motion
