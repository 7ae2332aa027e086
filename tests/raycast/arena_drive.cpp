#include "tests/raycast/arena_drive.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <stdexcept>
#include <utility>

namespace omnifleet::raycast {
namespace {

constexpr double kSpeed_mps = 0.20, kTurn_radps = 0.8, kTurnRate_radps2 = 4.0, kAcceleration_mps2 = 0.5;
constexpr double kPlanned_m = 0.15;   // clearance of base_link from everything
constexpr double kLeastGap_m = 0.02;  // of the circle around a body
constexpr double kSight_m = 0.75, kHalfView_rad = 0.65, kSpacing_m = 0.04;
constexpr double kOffFace_m = 0.02;
constexpr double kRobotGap_m = 0.06;  // between the circles of two robots

/// Drives to goals chosen by what they show; turns at each goal as long as this shows unseen faces.
class Mapper {
 public:
  Mapper(const FreeSpace& space, const House& house, const Pose2& start)
      : pose(start), space_(&space), house_(&house) {}

  void drive(const Eigen::Vector2d& other, const FaceSamples& faces, Random& random) {
    while (!way_.empty() && (way_.front() - pose.translation()).norm() < 0.05) way_.erase(way_.begin());
    double wanted_turn = 0.0, wanted_mps = 0.0;
    if (!way_.empty()) {
      const Eigen::Vector2d to = pose.inverse() * way_.front();
      const double bearing = std::atan2(to.y(), to.x());
      wanted_turn = 3.0 * bearing;
      if (std::abs(bearing) < 0.5)
        wanted_mps = std::min(kSpeed_mps * std::cos(bearing), 0.03 + 1.5 * to.norm());
    } else if (heading_) {
      const double left = wrapAngle(*heading_ - pose.theta_rad);
      wanted_turn = 3.0 * left;
      if (std::abs(left) < 0.05) heading_.reset();
    } else {
      choose(other, faces, random);
    }
    step(wanted_turn, wanted_mps, other);
  }

 private:
  /// First a heading that shows unseen faces from here, then another place.
  void choose(const Eigen::Vector2d& other, const FaceSamples& faces, Random& random) {
    constexpr std::size_t kWorthwhile = 4;
    constexpr int kCandidates = 50;
    const auto [shown, heading] = bestHeading(pose.translation(), faces);
    if (shown >= kWorthwhile && turns_ < 4) {
      heading_ = heading;
      ++turns_;
      return;
    }
    turns_ = 0;
    double best = -1.0;
    for (int k = 0; k < kCandidates; ++k) {
      const Eigen::Vector2d goal = space_->anywhere(random);
      if ((goal - other).norm() < 0.4) continue;
      const std::vector<Eigen::Vector2d> way = space_->path(pose.translation(), goal);
      double length = 0.4;
      Eigen::Vector2d from = pose.translation();
      for (const Eigen::Vector2d& to : way) length += (to - from).norm(), from = to;
      const double value = (1.0 + static_cast<double>(faces.unseenFrom(goal).size())) / length;
      if (way.empty() || value <= best) continue;
      best = value;
      way_ = way;
    }
  }

  static std::pair<std::size_t, double> bestHeading(const Eigen::Vector2d& from, const FaceSamples& faces) {
    constexpr int kHeadings = 24;
    const std::vector<std::size_t> unseen = faces.unseenFrom(from);
    std::pair<std::size_t, double> best{0, 0.0};
    for (int k = 0; k < kHeadings; ++k) {
      const double heading = 2.0 * M_PI * k / kHeadings;
      std::size_t shown = 0;
      for (const std::size_t sample : unseen) {
        const Eigen::Vector2d to = faces.at(sample) - from;
        if (std::abs(wrapAngle(std::atan2(to.y(), to.x()) - heading)) < kHalfView_rad) ++shown;
      }
      if (shown > best.first) best = {shown, heading};
    }
    return best;
  }

  bool isFree(const Eigen::Vector2d& at, const Eigen::Vector2d& other) const {
    if ((at - other).norm() < 2.0 * kBodyReach_m + kRobotGap_m) return false;
    for (const auto* list : {&house_->walls, &house_->furniture})
      for (const Solid& solid : *list)
        if (distanceTo(solid, at) < kBodyReach_m + kLeastGap_m) return false;
    return true;
  }

  /// Speeds change smoothly. The robot stops where the way ahead is not free.
  void step(double wanted_turn, double wanted_mps, const Eigen::Vector2d& other) {
    const double t = ArenaDrive::kTick_s;
    const auto towards = [](double now, double wanted, double most) {
      return now + std::clamp(wanted - now, -most, most);
    };
    turn_ = towards(turn_, std::clamp(wanted_turn, -kTurn_radps, kTurn_radps), kTurnRate_radps2 * t);
    speed_ = towards(speed_, wanted_mps, kAcceleration_mps2 * t);
    const double half = 0.5 * turn_ * t;
    const Pose2 next = pose * Pose2{speed_ * t * std::cos(half), speed_ * t * std::sin(half), 2.0 * half};
    const Eigen::Vector2d ahead = next * Eigen::Vector2d(0.5 * speed_ * speed_ / kAcceleration_mps2, 0.0);
    if (isFree(next.translation(), other) && isFree(ahead, other)) {
      pose = next;
      blocked_ = 0;
      return;
    }
    speed_ = 0.0;
    pose.theta_rad = wrapAngle(pose.theta_rad + 2.0 * half);
    constexpr int kPatience = 75;
    if (++blocked_ > kPatience) way_.clear(), blocked_ = 0;
  }

 public:
  Pose2 pose;

 private:
  const FreeSpace* space_;
  const House* house_;
  std::vector<Eigen::Vector2d> way_;
  std::optional<double> heading_;
  double speed_ = 0.0, turn_ = 0.0;
  int blocked_ = 0, turns_ = 0;
};

}  // namespace

FaceSamples::FaceSamples(const House& house) : solids_(house.walls) {
  solids_.insert(solids_.end(), house.furniture.begin(), house.furniture.end());
  for (const Solid& solid : solids_) {
    const Polygon outline = truthOf(solid, 0).outline_m;
    for (std::size_t k = 0; k < outline.size(); ++k) {
      const Eigen::Vector2d from = outline[k], edge = outline[(k + 1) % outline.size()] - from;
      const Eigen::Vector2d outward = Eigen::Vector2d(edge.y(), -edge.x()).normalized();
      const int count = std::max(1, static_cast<int>(edge.norm() / kSpacing_m));
      for (int j = 0; j < count; ++j) {
        const Eigen::Vector2d at = from + edge * ((j + 0.5) / count), off = at + kOffFace_m * outward;
        bool open = contains(house.inside, off);
        for (const Solid& other : solids_) open = open && distanceTo(other, off) > 0.5 * kOffFace_m;
        if (!open) continue;
        at_m_.push_back(at);
        outward_.push_back(outward);
      }
    }
  }
  seen_.resize(at_m_.size(), 0);
}

bool FaceSamples::isVisible(std::size_t sample, const Eigen::Vector2d& from) const {
  constexpr double kLeastCosine = 0.25;
  const Eigen::Vector2d to = at_m_[sample] - from;
  const double range = to.norm();
  if (range > kSight_m || range < 1e-6 || -outward_[sample].dot(to) < kLeastCosine * range) return false;
  const Eigen::Vector2d along = to / range;
  return std::none_of(solids_.begin(), solids_.end(), [&](const Solid& solid) {
    return rangeTo(solid, from, along) < range - 0.5 * kOffFace_m;
  });
}

std::vector<std::size_t> FaceSamples::unseenFrom(const Eigen::Vector2d& from) const {
  std::vector<std::size_t> unseen;
  for (std::size_t k = 0; k < at_m_.size(); ++k)
    if (seen_[k] == 0 && isVisible(k, from)) unseen.push_back(k);
  return unseen;
}

void FaceSamples::look(const Pose2& map_from_base) {
  for (const std::size_t sample : unseenFrom(map_from_base.translation())) {
    const Eigen::Vector2d to = map_from_base.inverse() * at_m_[sample];
    if (std::abs(std::atan2(to.y(), to.x())) < kHalfView_rad) seen_[sample] = 1;
  }
}

double FaceSamples::seenShare() const {
  return static_cast<double>(std::count(seen_.begin(), seen_.end(), 1)) / static_cast<double>(seen_.size());
}

ArenaDrive::ArenaDrive(const ArenaLayout& layout, double duration_s, Random& random) {
  constexpr double kLook_s = 0.2;
  constexpr int kTries = 1000;
  const House house = withParked(layout);
  const FreeSpace space(house, kPlanned_m);
  FaceSamples faces(layout.house);
  std::vector<Mapper> robots;
  for (int tries = 0; tries < kTries && static_cast<int>(robots.size()) < kMapping; ++tries) {
    const Eigen::Vector2d at = space.anywhere(random);
    const bool apart = robots.empty() || (robots.front().pose.translation() - at).norm() > 0.8;
    if (apart) robots.emplace_back(space, house, Pose2{at.x(), at.y(), random.between(-M_PI, M_PI)});
  }
  if (static_cast<int>(robots.size()) < kMapping) throw std::runtime_error("raycast: no place to start");
  poses_.resize(kMapping);
  const int ticks = static_cast<int>(std::ceil(duration_s / kTick_s)) + 1,
            look = static_cast<int>(std::lround(kLook_s / kTick_s));
  for (int tick = 0; tick <= ticks; ++tick) {
    for (std::size_t r = 0; r < robots.size(); ++r) {
      poses_[r].push_back(robots[r].pose);
      if (tick % look == 0) faces.look(robots[r].pose);
    }
    for (std::size_t r = 0; r < robots.size(); ++r)
      robots[r].drive(robots[1 - r].pose.translation(), faces, random);
  }
  seen_share_ = faces.seenShare();
}

Pose2 ArenaDrive::at(int robot, double time_s) const {
  const std::vector<Pose2>& poses = poses_[static_cast<std::size_t>(robot)];
  const double tick = std::clamp(time_s / kTick_s, 0.0, static_cast<double>(poses.size() - 1));
  const auto before = std::min(static_cast<std::size_t>(tick), poses.size() - 2);
  const Pose2 &a = poses[before], &b = poses[before + 1];
  const double share = tick - static_cast<double>(before);
  return {a.x_m + share * (b.x_m - a.x_m), a.y_m + share * (b.y_m - a.y_m),
          wrapAngle(a.theta_rad + share * wrapAngle(b.theta_rad - a.theta_rad))};
}

}  // namespace omnifleet::raycast
