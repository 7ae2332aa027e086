#include "motion/motion_guard.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace omnifleet::motion {
namespace {

constexpr double kStepM = 0.015, kStepRad = 0.12;  // between two tested poses
constexpr double kNoNearerM = 1e-6;                // rounding of "comes no nearer"

// Shares of the wanted speed and turn rate, the best first.
constexpr std::array<std::array<double, 2>, 8> kShares{
    {{1.0, 1.0}, {0.7, 1.0}, {0.45, 1.0}, {0.2, 1.0}, {0.0, 1.0}, {0.0, 0.4}, {0.3, 0.0}, {0.0, 0.0}}};

Pose2 moved(const Twist& twist, double dt_s) {
  return rolled(twist.forward_mps * dt_s - 0.5 * twist.turn_radps * dt_s,
                twist.forward_mps * dt_s + 0.5 * twist.turn_radps * dt_s, 1.0, Integration::kArc);
}

double towardsZero(double value, double most) {
  return value > 0.0 ? std::max(0.0, value - most) : std::min(0.0, value + most);
}

}  // namespace

Polygon placed(const Pose2& pose, const Polygon& polygon) {
  Polygon result;
  result.reserve(polygon.size());
  for (const Eigen::Vector2d& vertex : polygon) result.push_back(pose * vertex);
  return result;
}

double reachOf(const Polygon& polygon) {
  double reach_m = 0.0;
  for (const Eigen::Vector2d& vertex : polygon) reach_m = std::max(reach_m, vertex.norm());
  return reach_m;
}

/// Monotone chain (Andrew 1979).
Polygon hullOf(const Polygon& a, const Polygon& b) {
  Polygon points = a;
  points.insert(points.end(), b.begin(), b.end());
  std::sort(points.begin(), points.end(), [](const Eigen::Vector2d& p, const Eigen::Vector2d& q) {
    return p.x() != q.x() ? p.x() < q.x() : p.y() < q.y();
  });
  const auto chain = [](auto first, auto last) {
    Polygon half;
    for (; first != last; ++first) {
      while (half.size() >= 2) {
        const Eigen::Vector2d u = half.back() - half[half.size() - 2], v = *first - half.back();
        if (u.x() * v.y() - u.y() * v.x() > 0.0) break;
        half.pop_back();
      }
      half.push_back(*first);
    }
    half.pop_back();
    return half;
  };
  Polygon hull = chain(points.begin(), points.end());
  const Polygon upper = chain(points.rbegin(), points.rend());
  hull.insert(hull.end(), upper.begin(), upper.end());
  return hull;
}

double distanceBetween(const Polygon& a, const Polygon& b) {
  double least_m = std::numeric_limits<double>::infinity();
  for (const Eigen::Vector2d& vertex : a) least_m = std::min(least_m, distanceTo(b, vertex));
  for (const Eigen::Vector2d& vertex : b) least_m = std::min(least_m, distanceTo(a, vertex));
  return least_m;
}

MotionGuard::Options MotionGuard::Options::read(const options::Section& section) {
  Options options;
  section.read("margin_m", options.margin_m, {0.0, 1.0});
  section.read("braking_mps2", options.braking_mps2, {0.01, 50.0});
  section.read("turn_braking_radps2", options.turn_braking_radps2, {0.01, 500.0});
  section.finish();
  return options;
}

MotionGuard::MotionGuard(const Options& options, Polygon outline_m)
    : options_(options), outline_m_(std::move(outline_m)) {
  reach_m_ = reachOf(outline_m_);
}

/// Clearance of the outline at a pose to a barrier minus the required one, metres.
double MotionGuard::spareTo(std::size_t barrier, const Pose2& pose) const {
  const std::size_t points = near_.points_m.size();
  if (barrier < points)
    return distanceTo(outline_m_, pose.inverse() * near_.points_m[barrier]) - options_.margin_m;
  const Barriers::Solid& solid = near_.solids[barrier - points];
  return distanceBetween(placed(pose, outline_m_), solid.outline_m) - solid.margin_m;
}

bool MotionGuard::passes(const Pose2& pose) const {
  for (std::size_t barrier = 0; barrier < least_m_.size(); ++barrier) {
    if (spareTo(barrier, pose) < least_m_[barrier]) return false;
  }
  return true;
}

/// The poses of one frame of `first`, one of `second`, and braking.
void MotionGuard::follow(const Twist& first, const Twist& second, double dt_s) {
  Pose2 pose;
  const auto roll = [&](const Twist& twist, double duration_s) {
    const double steps = std::max(std::abs(twist.forward_mps) * duration_s / kStepM,
                                  std::abs(twist.turn_radps) * duration_s / kStepRad);
    const int n = std::max(1, static_cast<int>(std::ceil(steps)));
    for (int i = 0; i < n; ++i) {
      pose = pose * moved(twist, duration_s / n);
      path_.push_back(pose);
    }
  };
  path_.assign(1, pose);
  roll(first, dt_s);
  chosen_from_ = path_.size();
  roll(second, dt_s);
  Twist twist = second;
  constexpr double kBrakingStepS = 0.05;
  while (twist.forward_mps != 0.0 || twist.turn_radps != 0.0) {
    const Twist next{towardsZero(twist.forward_mps, options_.braking_mps2 * kBrakingStepS),
                     towardsZero(twist.turn_radps, options_.turn_braking_radps2 * kBrakingStepS)};
    roll({0.5 * (twist.forward_mps + next.forward_mps), 0.5 * (twist.turn_radps + next.turn_radps)},
         kBrakingStepS);
    twist = next;
  }
}

MotionGuard::Result MotionGuard::limit(const Twist& wanted, const Twist& before, double dt_s,
                                       const Barriers& barriers) {
  // Only what the body can reach before it stands.
  const double fastest_mps = std::max({std::abs(wanted.forward_mps), std::abs(before.forward_mps)});
  const double far_m = reach_m_ + options_.margin_m + 2.0 * fastest_mps * dt_s +
                       fastest_mps * fastest_mps / (2.0 * options_.braking_mps2) + kStepM;
  near_.points_m.clear();
  for (const Eigen::Vector2d& point_m : barriers.points_m) {
    if (point_m.norm() <= far_m) near_.points_m.push_back(point_m);
  }
  near_.solids.clear();
  for (const Barriers::Solid& solid : barriers.solids) {
    if (distanceTo(solid.outline_m, Eigen::Vector2d::Zero()) <= far_m + solid.margin_m)
      near_.solids.push_back(solid);
  }

  follow(before, {}, dt_s);
  // The command of the frame before leads here whatever is commanded now.
  const Pose2 next = path_[chosen_from_ - 1];
  least_m_.resize(near_.points_m.size() + near_.solids.size());
  for (std::size_t barrier = 0; barrier < least_m_.size(); ++barrier)
    least_m_[barrier] = std::min(0.0, spareTo(barrier, next)) - kNoNearerM;
  for (const auto& [speed, turn] : kShares) {
    const Twist twist{speed * wanted.forward_mps, turn * wanted.turn_radps};
    follow(before, twist, dt_s);
    const auto first = path_.begin() + static_cast<std::ptrdiff_t>(chosen_from_);
    if (std::all_of(first, path_.end(), [&](const Pose2& pose) { return passes(pose); }))
      return {twist, path_.back(), speed != 1.0 || turn != 1.0};
  }
  follow(before, {}, dt_s);
  return {{}, path_.back(), true};
}

}  // namespace omnifleet::motion
