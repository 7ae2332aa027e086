#include "motion/formation_law.h"

#include <algorithm>
#include <cmath>

namespace omnifleet::motion {
namespace {

constexpr double kStandstillMps = 1e-6;
constexpr double kBackingMps =
    0.12;  // m/s, slower velocities to the rear are driven backwards instead of turning around

Eigen::Vector2d direction(double angle_rad) {
  return {std::cos(angle_rad), std::sin(angle_rad)};
}

double towards(double value, double wanted, double most) {
  return value + std::clamp(wanted - value, -most, most);
}

/// Position in a triangle with rows of one, two, three …: row and place in the row.
struct RowPlace {
  std::size_t row, place, first_of_row_before;
};
RowPlace rowPlace(std::size_t rank) {
  std::size_t row = 0, first = 0;
  while (first + row + 1 <= rank) first += ++row;
  return {row, rank - first, row > 0 ? first - row : 0};
}

}  // namespace

Slot slotOf(FormationShape shape, std::size_t rank, double distance_m, double angle_rad) {
  // Odd ranks are on the left (they see the followed robot to the right, θ < 0), even ranks on the right.
  const double side = rank % 2 == 1 ? -1.0 : 1.0;
  const std::size_t before_on_side = rank <= 2 ? 0 : rank - 2;
  switch (shape) {
    case FormationShape::kColumn:
      return {rank - 1, distance_m, 0.0};
    case FormationShape::kLine:
      return {before_on_side, distance_m, side * 0.5 * M_PI};
    case FormationShape::kWedge:
      return {before_on_side, distance_m, side * angle_rad};
    case FormationShape::kTriangle:
      break;
  }
  // Rows are filled from the left. A place follows the robot of the row before to its right; the rightmost
  // place follows the one to its left.
  const RowPlace at = rowPlace(rank);
  const bool rightmost = at.place == at.row;
  const std::size_t followed = at.first_of_row_before + (rightmost ? at.place - 1 : at.place);
  return {followed, distance_m, (rightmost ? 1.0 : -1.0) * M_PI / 6.0};
}

bool isQueue(const Slot& slot) {
  constexpr double kStraight = 0.02;  // sine of θ
  return std::abs(std::sin(slot.angle_rad)) < kStraight && std::cos(slot.angle_rad) > 0.0;
}

std::vector<Eigen::Vector2d> placesOf(const FormationCommand& command, std::size_t robots) {
  std::vector<Eigen::Vector2d> places(robots, Eigen::Vector2d::Zero());
  for (std::size_t rank = 1; rank < robots; ++rank) {
    const Slot slot = slotOf(command.shape, rank, command.distance_m, command.angle_rad);
    places[rank] = places[slot.followed] - slot.distance_m * direction(slot.angle_rad);
  }
  return places;
}

FollowLaw::Options FollowLaw::Options::read(const options::Section& section) {
  Options options;
  section.read("gain_per_s", options.gain_per_s, {0.01, 10.0});
  section.read("closing_max_mps", options.closing_max_mps, {0.01, 5.0});
  section.read("swing_max_mps", options.swing_max_mps, {0.0, 5.0});
  section.read("patient_m", options.patient_m, {0.0, 10.0});
  section.read("near_m", options.near_m, {0.0, 1.0});
  section.read("stands_mps", options.stands_mps, {0.0, 1.0});
  section.finish();
  return options;
}

namespace {

/// Velocity without turning around: slower if the place lies behind, sideways no faster than forward.
Eigen::Vector2d patient(const Eigen::Vector2d& velocity_mps, double heading_rad) {
  const Eigen::Vector2d ahead = direction(heading_rad), left(-ahead.y(), ahead.x());
  const double along_mps = std::max(-kBackingMps, velocity_mps.dot(ahead));
  const double most_mps = std::max(0.0, along_mps);
  const double aside_mps = std::clamp(velocity_mps.dot(left), -most_mps, most_mps);
  return along_mps * ahead + aside_mps * left;
}

}  // namespace

Place FollowLaw::place(const Slot& slot, const Followed& followed) const {
  const double heading_rad = followed.heading_rad;
  const Eigen::Vector2d arm_m = -slot.distance_m * direction(heading_rad + slot.angle_rad);
  Eigen::Vector2d swing_mps = followed.twist.turn_radps * Eigen::Vector2d(-arm_m.y(), arm_m.x());
  if (swing_mps.norm() > options_.swing_max_mps) swing_mps *= options_.swing_max_mps / swing_mps.norm();
  return {followed.position_m + arm_m, followed.twist.forward_mps * direction(heading_rad) + swing_mps,
          heading_rad};
}

FollowLaw::Result FollowLaw::wanted(const Slot& slot, const Followed& followed, const Place& place) const {
  Result result;
  result.place_m = place.position_m;
  result.distance_error_m = followed.position_m.norm() - slot.distance_m;
  result.angle_error_rad =
      wrapAngle(std::atan2(followed.position_m.y(), followed.position_m.x()) - slot.angle_rad);
  Eigen::Vector2d closing_mps = options_.gain_per_s * result.place_m;
  if (closing_mps.norm() > options_.closing_max_mps)
    closing_mps *= options_.closing_max_mps / closing_mps.norm();
  result.velocity_mps = place.velocity_mps + closing_mps;
  const bool standing = place.velocity_mps.norm() < options_.stands_mps;
  if (!standing && result.place_m.norm() < options_.patient_m)
    result.velocity_mps = patient(result.velocity_mps, place.heading_rad);
  if (standing && result.place_m.norm() < options_.near_m) result.velocity_mps.setZero();
  return result;
}

LeadLaw::Options LeadLaw::Options::read(const options::Section& section) {
  Options options;
  section.read("passed_m", options.passed_m, {0.01, 5.0});
  section.read("arrived_m", options.arrived_m, {0.005, 5.0});
  section.read("slow_m", options.slow_m, {0.01, 5.0});
  section.read("wait_from_m", options.wait_from_m, {0.0, 10.0});
  section.read("wait_full_m", options.wait_full_m, {0.01, 10.0});
  section.read("wait_speed", options.wait_speed, {0.0, 1.0});
  section.finish();
  if (options.wait_full_m <= options.wait_from_m) section.fail("wait_full_m", "must exceed wait_from_m");
  return options;
}

void LeadLaw::follow(std::vector<Eigen::Vector2d> waypoints_m) {
  waypoints_m_ = std::move(waypoints_m);
  next_ = 0;
}

std::optional<Eigen::Vector2d> LeadLaw::waypoint() const {
  return arrived() ? std::nullopt : std::optional<Eigen::Vector2d>(waypoints_m_[next_]);
}

double LeadLaw::remainingDistance(const Eigen::Vector2d& here_m) const {
  double sum_m = 0.0;
  Eigen::Vector2d from_m = here_m;
  for (std::size_t i = next_; i < waypoints_m_.size(); ++i) {
    sum_m += (waypoints_m_[i] - from_m).norm();
    from_m = waypoints_m_[i];
  }
  return sum_m;
}

void LeadLaw::passed(const Eigen::Vector2d& here_m) {
  while (!arrived()) {
    const bool goal = next_ + 1 == waypoints_m_.size();
    if ((waypoints_m_[next_] - here_m).norm() > (goal ? options_.arrived_m : options_.passed_m)) break;
    ++next_;
  }
}

Eigen::Vector2d LeadLaw::wanted(const Pose2& map_from_base, double worst_follower_m, double cruise_mps,
                                const std::optional<Eigen::Vector2d>& via_m) {
  passed(map_from_base.translation());
  if (arrived()) return Eigen::Vector2d::Zero();
  const Eigen::Vector2d next_m = via_m.value_or(waypoints_m_[next_]);
  const Eigen::Vector2d way_m = map_from_base.inverse() * next_m;
  const double left_m = way_m.norm() + (waypoints_m_[next_] - next_m).norm();
  double speed_mps = cruise_mps;
  if (next_ + 1 == waypoints_m_.size()) speed_mps *= std::clamp(left_m / options_.slow_m, 0.2, 1.0);
  const double late = std::clamp(
      (worst_follower_m - options_.wait_from_m) / (options_.wait_full_m - options_.wait_from_m), 0.0, 1.0);
  speed_mps *= 1.0 - late * (1.0 - options_.wait_speed);
  return speed_mps * way_m.normalized();
}

Twist twistTowards(const Eigen::Vector2d& velocity_mps, double feed_radps, const Twist& before, double dt_s,
                   double max_turn_radps, const DriveLimits& limits) {
  Twist wanted;
  const double speed_mps = std::min(velocity_mps.norm(), limits.max_mps);
  if (speed_mps > kStandstillMps) {
    double off_rad = std::atan2(velocity_mps.y(), velocity_mps.x());
    const bool back = std::abs(off_rad) > 0.6 * M_PI && speed_mps < kBackingMps;
    if (back) off_rad = wrapAngle(off_rad - M_PI);
    const double ahead = std::max(0.0, std::cos(off_rad));
    wanted.forward_mps = (back ? -1.0 : 1.0) * speed_mps * ahead * ahead;
    wanted.turn_radps =
        std::clamp(limits.turn_gain_per_s * off_rad + feed_radps * ahead, -max_turn_radps, max_turn_radps);
  }
  return {towards(before.forward_mps, wanted.forward_mps, limits.max_mps2 * dt_s),
          towards(before.turn_radps, wanted.turn_radps, limits.max_turn_radps2 * dt_s)};
}

}  // namespace omnifleet::motion
