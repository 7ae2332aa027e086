#include "motion/trail.h"

#include <cmath>

namespace omnifleet::motion {
namespace {

constexpr double kSpacingM = 0.02;
constexpr std::size_t kMost = 200;

}  // namespace

void Trail::setPose(const Pose2& map_from_base) {
  if (!in_map_) {
    const Pose2 map_from_frame = map_from_base * frame_from_base_.inverse();
    for (Eigen::Vector2d& place_m : places_m_) place_m = map_from_frame * place_m;
  }
  in_map_ = true;
  frame_from_base_ = map_from_base;
}

void Trail::add(const Eigen::Vector2d& place_in_base_m) {
  const Eigen::Vector2d place_m = frame_from_base_ * place_in_base_m;
  // The newest place is replaced until it is far enough from the one before.
  if (places_m_.size() > 1 && (places_m_[0] - places_m_[1]).norm() < kSpacingM) places_m_.pop_front();
  places_m_.push_front(place_m);
  if (places_m_.size() > kMost) places_m_.pop_back();
}

Trail::Spot Trail::at(double back_m, double heading_rad) const {
  const Pose2 base_from_frame = frame_from_base_.inverse();
  const double known_rad = heading_rad + frame_from_base_.theta_rad;
  Spot spot{Eigen::Vector2d::Zero(), {std::cos(heading_rad), std::sin(heading_rad)}};
  if (places_m_.empty()) return spot;
  spot = {places_m_.front(), {std::cos(known_rad), std::sin(known_rad)}};
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
  return {base_from_frame * spot.place_m, base_from_frame.rotation() * spot.ahead};
}

double Trail::length_m() const {
  double sum_m = 0.0;
  for (std::size_t i = 0; i + 1 < places_m_.size(); ++i) sum_m += (places_m_[i] - places_m_[i + 1]).norm();
  return sum_m;
}

}  // namespace omnifleet::motion
