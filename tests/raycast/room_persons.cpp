#include "tests/raycast/room_persons.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <optional>
#include <stdexcept>

namespace omnifleet::raycast {
namespace {

constexpr double kLeg_m = 0.12, kLegHeight_m = 0.85, kCoat_m = 0.36, kCoatHeight_m = 1.3;
constexpr double kLegBeside_m = 0.09, kStep_m = 0.12;  // of a leg from the middle: sideways, ahead at most
constexpr double kPerson_m = 0.21;                     // radius of the circle around both legs
constexpr double kToRobot_m = kRobotRadius_m + kPerson_m + 0.09;  // 0.45 m between the centres
constexpr double kWalk_mps = 1.2, kLeft_m = 2.0;                  // farther persons are left behind
constexpr double kOffMiddle_m = 0.036;  // of a place from the middle of its 5 cm cell, at most
constexpr int kMostPersons = 40;

Eigen::Vector2d unit(double angle_rad) {
  return {std::cos(angle_rad), std::sin(angle_rad)};
}

class Person {
 public:
  Person(int number, Random& random)
      : number_(number),
        trousers_(random.colour(0.02, 0.5)),
        range_m_(random.between(0.55, 0.95)),
        bearing_rad_(random.between(0.0, 2.0 * M_PI)),
        turning_radps_(random.between(0.1, 0.4) * (number % 2 == 0 ? 1.0 : -1.0)),
        sway_(random.between(0.0, 2.0 * M_PI)) {}

  bool isPresent() const { return present_; }
  const Eigen::Vector2d& at() const { return at_m_; }

  /// Every second person keeps beside or behind the robot, the others walk around it.
  Eigen::Vector2d wishedPlace(const Pose2& robot, double now_s) const {
    const double beside = robot.theta_rad + 0.9 + bearing_rad_ * (2.0 * M_PI - 1.8) / (2.0 * M_PI) +
                          0.3 * std::sin(0.8 * now_s + sway_);
    const double bearing = number_ % 2 == 0 ? beside : bearing_rad_ + turning_radps_ * now_s;
    const double range = range_m_ + 0.15 * std::sin(0.5 * now_s + 2.0 * sway_);
    return robot.translation() + range * unit(bearing);
  }

  void walkTo(const Eigen::Vector2d& place) {
    const Eigen::Vector2d way = place - at_m_;
    if (present_ && way.norm() > 0.01) heading_ = way.normalized();
    if (present_) phase_rad_ += 2.0 * M_PI * way.norm() / (4.0 * kStep_m);
    at_m_ = place;
    present_ = true;
  }
  void leave() { present_ = false; }

  void addTo(std::vector<Solid>& solids) const {
    const auto upright = [&](const Eigen::Vector2d& place, double diameter_m, double height_m) {
      Solid solid;
      solid.round = true;
      solid.map_from_solid = {place.x(), place.y(), 0.0};
      solid.size_m = Eigen::Vector2d::Constant(diameter_m);
      solid.height_m = height_m;
      solid.albedo = trousers_;
      solids.push_back(solid);
    };
    if (number_ % 3 == 2) return upright(at_m_, kCoat_m, kCoatHeight_m);
    const Eigen::Vector2d beside = kLegBeside_m * Eigen::Vector2d(-heading_.y(), heading_.x()),
                          ahead = kStep_m * std::sin(phase_rad_) * heading_;
    upright(at_m_ + beside + ahead, kLeg_m, kLegHeight_m);
    upright(at_m_ - beside - ahead, kLeg_m, kLegHeight_m);
  }

 private:
  int number_;
  Eigen::Vector3d trousers_;
  double range_m_, bearing_rad_, turning_radps_, sway_, phase_rad_ = 0.0;
  Eigen::Vector2d at_m_ = Eigen::Vector2d::Zero(), heading_ = Eigen::Vector2d::UnitX();
  bool present_ = false;
};

class Crowd {
 public:
  Crowd(const FreeSpace& space, int size, unsigned seed) : space_(&space) {
    Random random(seed * 15485863U + 29U);
    for (int k = 0; k < size; ++k) persons_.emplace_back(k, random);
  }

  void walk(const std::vector<Pose2>& robots, double now_s, double passed_s) {
    for (Person& person : persons_) {
      const Eigen::Vector2d wished = person.wishedPlace(robots.front(), now_s);
      const bool is_left = (person.at() - robots.front().translation()).norm() > kLeft_m;
      std::optional<Eigen::Vector2d> place;
      if (person.isPresent() && !is_left)
        place = bestPlace(person, person.at(), kWalk_mps * passed_s, wished, robots);
      const Eigen::Vector2d around = person.isPresent() && !is_left ? person.at() : wished;
      for (double reach = 0.2; reach < 1.0 && !place; reach += 0.2)
        place = bestPlace(person, around, reach, wished, robots);
      if (place)
        person.walkTo(*place);
      else
        person.leave();
    }
  }

  std::vector<Solid> solids() const {
    std::vector<Solid> solids;
    for (const Person& person : persons_)
      if (person.isPresent()) person.addTo(solids);
    return solids;
  }

 private:
  /// The valid place nearest to the wished one, within `reach_m` around `around`.
  std::optional<Eigen::Vector2d> bestPlace(const Person& person, const Eigen::Vector2d& around,
                                           double reach_m, const Eigen::Vector2d& wished,
                                           const std::vector<Pose2>& robots) const {
    constexpr int kDirections = 16, kSteps = 2;
    Eigen::Vector2d best = around;
    double least = std::numeric_limits<double>::infinity();
    const auto consider = [&](const Eigen::Vector2d& place) {
      const double cost = (place - wished).norm() + (isInWay(place, robots.front()) ? 1.0 : 0.0);
      if (cost >= least || !isValid(person, place, robots)) return;
      least = cost;
      best = place;
    };
    if ((wished - around).norm() < reach_m) consider(wished);
    consider(around);
    for (int d = 0; d < kDirections; ++d)
      for (int s = 1; s <= kSteps; ++s)
        consider(around + reach_m * s / kSteps * unit(2.0 * M_PI * d / kDirections));
    return std::isfinite(least) ? std::optional<Eigen::Vector2d>(best) : std::nullopt;
  }

  bool isValid(const Person& person, const Eigen::Vector2d& place, const std::vector<Pose2>& robots) const {
    if (!space_->isFree(place)) return false;
    for (const Pose2& robot : robots)
      if ((robot.translation() - place).norm() < kToRobot_m) return false;
    return std::none_of(persons_.begin(), persons_.end(), [&](const Person& other) {
      return &other != &person && other.isPresent() && (other.at() - place).norm() < 2.0 * kPerson_m;
    });
  }

  static bool isInWay(const Eigen::Vector2d& place, const Pose2& robot) {
    const Eigen::Vector2d own = robot.inverse() * place;
    return own.norm() < 0.9 && std::abs(std::atan2(own.y(), own.x())) < 0.6;
  }

  const FreeSpace* space_;
  std::vector<Person> persons_;
};

}  // namespace

double occludedShare(const House& house, const std::vector<Solid>& persons, const Eigen::Vector2d& at) {
  constexpr int kBearings = 120;
  int occluded = 0;
  for (int k = 0; k < kBearings; ++k) {
    const Eigen::Vector2d along = unit(2.0 * M_PI * k / kBearings);
    double person_m = kOccluder_m, other_m = std::numeric_limits<double>::infinity();
    for (const Solid& person : persons) person_m = std::min(person_m, rangeTo(person, at, along));
    if (person_m >= kOccluder_m) continue;
    for (const auto* list : {&house.walls, &house.furniture})
      for (const Solid& solid : *list) other_m = std::min(other_m, rangeTo(solid, at, along));
    occluded += person_m < other_m ? 1 : 0;
  }
  return static_cast<double>(occluded) / kBearings;
}

std::vector<std::vector<Solid>> personsAround(const House& house, const Drive& drive,
                                              const FurnishedOptions& options) {
  const FreeSpace space(house, kPerson_m + kOffMiddle_m);
  double reached = 0.0;
  for (int size = 1; size <= kMostPersons; ++size) {
    Crowd crowd(space, size, options.seed);
    std::vector<std::vector<Solid>> frames;
    double sum = 0.0, before_s = 0.0;
    for (const DriveFrame& frame : drive.frames) {
      const double now_s = secondsOf(frame.time_ns);
      crowd.walk(frame.poses, now_s, now_s - before_s);
      before_s = now_s;
      frames.push_back(crowd.solids());
      sum += occludedShare(house, frames.back(), frame.poses.front().translation());
    }
    const double share = sum / static_cast<double>(std::max<std::size_t>(1, frames.size()));
    if (share >= options.occluded_share) return frames;
    reached = std::max(reached, share);
  }
  throw std::runtime_error(fmt::format(
      "raycast: {} persons occlude {:.0f} % of the bearings, not {:.0f} %; choose a smaller share",
      kMostPersons, 100.0 * reached, 100.0 * options.occluded_share));
}

}  // namespace omnifleet::raycast
