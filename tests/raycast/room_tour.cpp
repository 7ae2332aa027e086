#include "tests/raycast/room_tour.h"

#include <algorithm>
#include <cmath>
#include <memory>
#include <stdexcept>

namespace omnifleet::raycast {
namespace {

using Way = std::vector<Eigen::Vector2d>;

constexpr double kSpare_m = 0.6;  // a driven path is longer than the planned one
constexpr double kNoWay_m = 1e9;

double lengthOf(const Way& way, const Eigen::Vector2d& from) {
  double length = 0.0;
  Eigen::Vector2d at = from;
  for (const Eigen::Vector2d& next : way) {
    length += (next - at).norm();
    at = next;
  }
  return length;
}

double wayLength(const FreeSpace& space, const Eigen::Vector2d& from, const Eigen::Vector2d& to) {
  const Way way = space.path(from, to);
  return way.empty() ? kNoWay_m : lengthOf(way, from);
}

/// Free places around the middle of the room, at a share of the greatest free distance in their direction.
Way ringOf(const FreeSpace& space, const Eigen::Vector2d& middle, double share, double begin_rad,
           double turn) {
  constexpr int kPlaces = 10;
  constexpr double kFarthest_m = 8.0, kStep_m = 0.05;
  Way ring;
  for (int k = 0; k < kPlaces; ++k) {
    const double angle = begin_rad + turn * 2.0 * M_PI * k / kPlaces;
    const Eigen::Vector2d along(std::cos(angle), std::sin(angle));
    double farthest = 0.0;
    for (double range = 0.0; range < kFarthest_m; range += kStep_m)
      if (space.isFree(middle + range * along)) farthest = range;
    ring.push_back(space.nearestFree(middle + share * farthest * along));
  }
  return ring;
}

class Tour {
 public:
  Tour(const FreeSpace& space, double length_m, Random& random) : space_(&space), length_m_(length_m) {
    const double begin = random.between(0.0, 2.0 * M_PI), turn = random.below(2) == 0 ? 1.0 : -1.0;
    const Eigen::Vector2d middle(random.between(-0.3, 0.3), random.between(-0.3, 0.3));
    for (double share = random.between(0.8, 1.0); share > 0.1 && lap_.empty(); share -= 0.1) {
      lap_ = ringOf(space, middle, share, begin, turn);
      lap_.push_back(lap_.front());
      double lap_m = 0.0;
      for (std::size_t k = 1; k < lap_.size(); ++k) lap_m += wayLength(space, lap_[k - 1], lap_[k]);
      if (lap_m > 0.9 * length_m || lap_m < kLeastLap_m) lap_.clear();
    }
    if (lap_.empty()) throw std::runtime_error("raycast: a loop needs more frames or longer steps");
    start_ = lap_.front();
    const Eigen::Vector2d ahead = lap_[1] - start_;
    heading_rad_ = std::atan2(ahead.y(), ahead.x()) + random.between(-0.3, 0.3);
    lap_.erase(lap_.begin());
  }

  Pose2 start() const { return {start_.x(), start_.y(), heading_rad_}; }

  Eigen::Vector2d nextGoal(const Pose2& pose, double travelled_m, Random& random) {
    if (!lap_.empty()) {
      const Eigen::Vector2d goal = lap_.front();
      lap_.erase(lap_.begin());
      return goal;
    }
    constexpr int kTries = 40;
    for (int tries = 0; tries < kTries && !is_back_; ++tries) {
      const Eigen::Vector2d goal = space_->anywhere(random);
      const Way way = space_->path(pose.translation(), goal);
      if (way.empty() || lengthOf(way, pose.translation()) < 1.0) continue;
      const Eigen::Vector2d ahead = pose.inverse() * way.front();
      const bool turns_little = std::abs(std::atan2(ahead.y(), ahead.x())) < kMostTurn_rad;
      if (!turns_little && tries < kTries / 2) continue;
      const double needed = lengthOf(way, pose.translation()) + wayLength(*space_, goal, start_) + kSpare_m;
      if (travelled_m + needed < length_m_) return goal;
    }
    const bool is_away = (pose.translation() - start_).norm() > 1.0;
    if (is_back_ || !is_away) return space_->anywhere(random);
    is_back_ = true;
    return start_;
  }

 private:
  static constexpr double kMostTurn_rad = 100.0 * M_PI / 180.0, kLeastLap_m = 3.0;

  const FreeSpace* space_;
  double length_m_;
  Way lap_;  ///< goals still ahead
  Eigen::Vector2d start_;
  double heading_rad_ = 0.0;
  bool is_back_ = false;  ///< on its last way to the start, or past it
};

}  // namespace

DrivePlan tourOf(const FurnishedOptions& options, const FreeSpace& space, Random& random) {
  const double length_m = 0.5 * (options.step_min_m + options.step_max_m) * options.frames;
  const auto tour = std::make_shared<Tour>(space, length_m, random);
  DrivePlan plan;
  plan.starts = {tour->start()};
  plan.next_goal = [tour](std::size_t, const Pose2& pose, double travelled_m, Random& chance) {
    return tour->nextGoal(pose, travelled_m, chance);
  };
  return plan;
}

}  // namespace omnifleet::raycast
