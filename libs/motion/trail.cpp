#include "motion/trail.h"

#include <cmath>

namespace omnifleet::motion {
namespace {

constexpr double kSpacingM = 0.02;
constexpr std::size_t kMost = 200;

}  // namespace

void Trail::moved(const Pose2& previous_from_current) {
  const Pose2 current_from_previous = previous_from_current.inverse();
  for (Eigen::Vector2d& place_m : places_m_) place_m = current_from_previous * place_m;
}

void Trail::add(const Eigen::Vector2d& place_m) {
  // The newest place moves on until it is far enough from the one before.
  if (places_m_.size() > 1 && (places_m_[0] - places_m_[1]).norm() < kSpacingM) places_m_.pop_front();
  places_m_.push_front(place_m);
  if (places_m_.size() > kMost) places_m_.pop_back();
}

Trail::Spot Trail::at(double back_m, double heading_rad) const {
  Spot spot{Eigen::Vector2d::Zero(), {std::cos(heading_rad), std::sin(heading_rad)}};
  if (places_m_.empty()) return spot;
  spot.place_m = places_m_.front();
  double left_m = back_m;
  for (std::size_t i = 0; i + 1 < places_m_.size(); ++i) {
    const Eigen::Vector2d way_m = places_m_[i] - places_m_[i + 1];
    const double length_m = way_m.norm();
    if (length_m >= kSpacingM) spot.ahead = way_m / length_m;
    if (left_m <= length_m) break;
    left_m -= length_m;
    spot.place_m = places_m_[i + 1];
  }
  spot.place_m -= left_m * spot.ahead;
  return spot;
}

double Trail::length_m() const {
  double sum_m = 0.0;
  for (std::size_t i = 0; i + 1 < places_m_.size(); ++i) sum_m += (places_m_[i] - places_m_[i + 1]).norm();
  return sum_m;
}

}  // namespace omnifleet::motion
