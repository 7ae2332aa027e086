#include "tests/raycast/room_path.h"

#include <algorithm>
#include <cmath>
#include <stdexcept>

namespace omnifleet::raycast {
namespace {

constexpr double kSpeed_mps = 0.25, kTurn_radps = 0.8, kDrive_s = 0.02;
constexpr double kApart_m = 0.5;        // centres of two robots
constexpr double kLongest_s = 36000.0;  // of a drive
constexpr int kTicksPerRow = 5;
static_assert(kTicksPerRow * kDrive_s == kWheelRow_s);

/// Drives towards a goal along its path: turns on the way, slower in bends. Waits for other robots.
class Driver {
 public:
  Driver(const FreeSpace& space, const Pose2& start) : space_(&space), pose(start) {}

  bool needsGoal() const { return way_.empty(); }
  void goTo(const Eigen::Vector2d& goal) { way_ = space_->path(pose.translation(), goal); }

  void drive(const std::vector<Eigen::Vector2d>& others) {
    while (!way_.empty() && (way_.front() - pose.translation()).norm() < 0.08) way_.erase(way_.begin());
    stand();
    if (way_.empty()) return;
    const Eigen::Vector2d to = pose.inverse() * way_.front();
    const double bearing = std::atan2(to.y(), to.x());
    const double turn = std::clamp(2.5 * bearing, -kTurn_radps, kTurn_radps);
    double speed = std::abs(bearing) > 0.6 ? 0.0 : kSpeed_mps * std::cos(bearing);
    speed = std::min(speed, 0.05 + 0.9 * to.norm());
    const Eigen::Vector2d next = pose * Eigen::Vector2d(speed > 0 ? 0.15 : 0.0, 0.0);
    for (const Eigen::Vector2d& other : others) {
      if ((next - other).norm() > kApart_m || speed <= 0.0) continue;
      speed = 0.0;
      if (++blocked_ > 100) way_.clear(), blocked_ = 0;
    }
    left_mps = speed - 0.5 * kWheelSeparation_m * turn;
    right_mps = speed + 0.5 * kWheelSeparation_m * turn;
    const double half = 0.5 * turn * kDrive_s,
                 chord = speed * kDrive_s * (std::abs(half) < 1e-9 ? 1.0 : std::sin(half) / half);
    pose = pose * Pose2{chord * std::cos(half), chord * std::sin(half), 2.0 * half};
    travelled_m += std::abs(chord);
  }
  void stand() { left_mps = right_mps = 0.0; }
  void forgetGoal() { way_.clear(); }

 private:
  const FreeSpace* space_;
  std::vector<Eigen::Vector2d> way_;
  int blocked_ = 0;

 public:
  Pose2 pose;
  double left_mps = 0.0, right_mps = 0.0, travelled_m = 0.0;
};

/// Lifts a robot at a given time and carries it to another place in a straight line.
class Kidnapping {
 public:
  explicit Kidnapping(const FurnishedOptions& options) : random_(options.seed * 104729U + 71U) {
    if (options.kidnapped_s) begin_s_ = *options.kidnapped_s;
  }

  bool isLifted() const { return lifted_; }
  const Pose2& target() const { return to_; }

  /// Moves the robot if it is lifted at this time.
  void carry(double now_s, const FreeSpace& space, Driver& robot, const std::vector<Driver>& all) {
    constexpr double kTick_s = 1e-9;
    const double share = (now_s - begin_s_) / kKidnapped_s;
    const bool lifted = now_s > begin_s_ - kTick_s && now_s < begin_s_ + kKidnapped_s - kTick_s;
    if (lifted && !lifted_) choose(space, robot, all);
    if (lifted)
      robot.pose = from_ * Pose2{share * way_.x_m, share * way_.y_m, share * way_.theta_rad};
    else if (lifted_)
      robot.pose = to_;
    lifted_ = lifted;
  }

 private:
  void choose(const FreeSpace& space, Driver& robot, const std::vector<Driver>& all) {
    constexpr double kLeastWay_m = 1.5;
    constexpr int kTries = 100000;
    for (int tries = 0; tries < kTries; ++tries) {
      const Eigen::Vector2d at = space.anywhere(random_);
      bool fits = (at - robot.pose.translation()).norm() > kLeastWay_m;
      for (const Driver& other : all)
        fits = fits && (&other == &robot || (other.pose.translation() - at).norm() > 2.0 * kApart_m);
      if (!fits) continue;
      from_ = robot.pose;
      to_ = {at.x(), at.y(), random_.between(-M_PI, M_PI)};
      way_ = from_.inverse() * to_;
      robot.forgetGoal();
      return;
    }
    throw std::runtime_error("raycast: no place to set the kidnapped robot down; choose another seed");
  }

  Random random_;
  double begin_s_ = 2.0 * kLongest_s;
  bool lifted_ = false;
  Pose2 from_, to_, way_;
};

std::vector<Driver> placed(const FurnishedOptions& options, const FreeSpace& space, const DrivePlan& plan,
                           Random& random) {
  std::vector<Driver> drivers;
  for (const Pose2& start : plan.starts) drivers.emplace_back(space, start);
  while (static_cast<int>(drivers.size()) < options.robots) {
    const Eigen::Vector2d at = space.anywhere(random);
    bool apart = true;
    for (const Driver& other : drivers)
      apart = apart && (other.pose.translation() - at).norm() > 2.0 * kApart_m;
    if (apart) drivers.emplace_back(space, Pose2{at.x(), at.y(), random.between(-M_PI, M_PI)});
  }
  return drivers;
}

/// Decides when a frame is taken: at a rate, or by the way of the first robot.
class Shutter {
 public:
  explicit Shutter(const FurnishedOptions& options) : options_(&options) {}

  bool isDue(double now_s, double travelled_m, Random& random) {
    const bool by_distance = options_->step_max_m > 0.0;
    if (by_distance ? travelled_m < due_m_ : now_s < due_s_ - 1e-9) return false;
    due_s_ += 1.0 / options_->rate_hz;
    if (by_distance) due_m_ = travelled_m + random.between(options_->step_min_m, options_->step_max_m);
    return true;
  }

 private:
  const FurnishedOptions* options_;
  double due_s_ = 0.0, due_m_ = 0.0;
};

/// All robots drive for one tick, except for the first one while it is lifted.
void driveOnce(std::vector<Driver>& drivers, const Kidnapping& kidnapping, const DrivePlan& plan,
               const FreeSpace& space, Random& random, WheelStep& row) {
  for (std::size_t r = 0; r < drivers.size(); ++r) {
    std::vector<Eigen::Vector2d> others;
    for (std::size_t o = 0; o < drivers.size(); ++o)
      if (o != r)
        others.push_back(
            (o == 0 && kidnapping.isLifted() ? kidnapping.target() : drivers[o].pose).translation());
    Driver& driver = drivers[r];
    if (r == 0 && kidnapping.isLifted()) {
      driver.stand();
    } else {
      if (driver.needsGoal())
        driver.goTo(plan.next_goal ? plan.next_goal(r, driver.pose, driver.travelled_m, random)
                                   : space.anywhere(random));
      driver.drive(others);
    }
    row.speed_mps[r] += Eigen::Vector2d(driver.left_mps, driver.right_mps) / kTicksPerRow;
  }
}

}  // namespace

Drive driveAll(const FurnishedOptions& options, const FreeSpace& space, Random& random,
               const DrivePlan& plan) {
  std::vector<Driver> drivers = placed(options, space, plan, random);
  Kidnapping kidnapping(options);
  Shutter shutter(options);
  Drive drive;
  const auto isOver = [&](double now_s) {
    return options.duration_s > 0.0 ? now_s >= options.duration_s - 1e-9
                                    : static_cast<int>(drive.frames.size()) >= options.frames;
  };
  for (int tick = 0; !isOver(tick * kDrive_s); ++tick) {
    const double now_s = tick * kDrive_s;
    const TimeNs now_ns = kBegin_ns + static_cast<TimeNs>(std::llround(1e9 * now_s));
    if (now_s > kLongest_s) throw std::runtime_error("raycast: the robots block each other");
    kidnapping.carry(now_s, space, drivers.front(), drivers);
    if (shutter.isDue(now_s, drivers.front().travelled_m, random)) {
      DriveFrame frame{now_ns, {}, kidnapping.isLifted()};
      for (const Driver& driver : drivers) frame.poses.push_back(driver.pose);
      drive.frames.push_back(frame);
    }
    if (tick % kTicksPerRow == 0)
      drive.wheels.push_back({now_ns, std::vector<Eigen::Vector2d>(drivers.size(), Eigen::Vector2d::Zero())});
    driveOnce(drivers, kidnapping, plan, space, random, drive.wheels.back());
  }
  return drive;
}

}  // namespace omnifleet::raycast
