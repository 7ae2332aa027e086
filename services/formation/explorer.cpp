#include "formation/explorer.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "formation/fleet_view.h"
#include "motion/motion_guard.h"
#include "motion/view.h"

namespace omnifleet::formation {
namespace {

constexpr double kSameGoalM = 0.15;     // m, a frontier that moves by less is the same goal
constexpr double kProgressS = 0.5;      // s, the time left must fall by this much to count as progress
constexpr double kCarrotM = 0.6;        // m, farthest point of the path that the robot heads for
constexpr std::size_t kMostLooks = 3;   // from different places, until a frontier is skipped
constexpr double kSameViewCells = 4.0;  // a viewpoint that moves by less is the same
const Eigen::Vector2d kNowhere_m(1e9, 1e9);
constexpr TimeNs kSweep_ns = 1000000000;  // in one direction
constexpr double kSweep_radps = 0.1;
constexpr double kUnknownS = 1e9;    // s
constexpr double kFirstWaits = 4.0;  // times as long as a later robot the first one waits
constexpr double kRetreatS = 4.0;    // s, longest way made
constexpr double kRetreatM = 0.8;    // m, likewise
constexpr int kDonePlans = 3;        // successive plans without frontiers until all is explored
constexpr double kSlowest = 0.2;     // share of the cruise speed next to a viewpoint
constexpr double kSlowM = 0.15;      // m, within which the speed falls

}  // namespace

Explorer::Options Explorer::Options::read(const options::Section& section) {
  Options options;
  options.plan = motion::Exploration::Options::read(section.child("plan"));
  section.read("plan_period_s", options.plan_period_s, {0.01, 10.0});
  section.read("silent_s", options.silent_s, options::kPositive);
  section.read("look_s", options.look_s, options::kPositive);
  section.read("stuck_s", options.stuck_s, options::kPositive);
  section.read("yield_s", options.yield_s, options::kPositive);
  section.read("longest_s", options.longest_s, options::kPositive);
  section.read("arrived_m", options.arrived_m, {0.005, 1.0});
  section.read("arrived_rad", options.arrived_rad, {0.01, 1.0});
  section.read("turn_in_place_rad", options.turn_in_place_rad, {0.05, 1.5});
  section.finish();
  return options;
}

Explorer::Explorer(const std::string& robot, const std::map<std::string, RobotBody>& bodies,
                   const Options& options, const motion::DriveLimits& limits)
    : robot_(robot), options_(options), limits_(limits), exploration_([&] {
        motion::Exploration::Options plan = options.plan;
        plan.cruise_mps = limits.cruise_mps;
        plan.turn_radps = limits.max_turn_radps;
        return plan;
      }()) {
  for (const auto& [name, body] : bodies) radius_m_[name] = motion::reachOf(body.outline());
  restart();
}

void Explorer::restart() {
  goal_.reset();
  skipped_.clear();
  frontiers_ = 0;
  planned_period_ = -1;
  done_plans_ = 0;
  failed_m_.clear();
  blocked_s_ = 0.0;
  retreat_.reset();
  retried_ = false;
}

/// All robots at their published poses, by name.
std::vector<motion::Explorer> Explorer::team(const SharedGrid& shared, TimeNs now_ns,
                                             std::size_t& own) const {
  std::vector<motion::Explorer> robots;
  for (const auto& [name, radius_m] : radius_m_) {
    const auto pose = shared.pose(name);
    if (!pose) continue;
    motion::Explorer robot;
    robot.name = name;
    robot.map_from_base = *pose;
    robot.radius_m = radius_m;
    robot.outline_m = shared.outline(name, *pose);
    const auto stated = shared.stated().find(name);
    if (stated != shared.stated().end()) {
      const motion::FormationState& state = stated->second.state;
      robot.explores = state.behaviour == motion::Behaviour::kExploration &&
                       seconds(state.acquired_ns, now_ns) <= options_.silent_s;
      robot.field_of_view_rad = motion::fieldOfView(state.view);
      robot.blind_m = state.view.blind_m + state.view.origin_m.norm();
      if (state.has_goal) robot.goal_m = state.goal_m;
      robot.skipped = state.skipped;
    }
    if (name == robot_) own = robots.size();
    robots.push_back(std::move(robot));
  }
  return robots;
}

void Explorer::choose(const Frame& frame, const SharedGrid& shared) {
  const auto period = frame.acquired_ns / static_cast<TimeNs>(1e9 * options_.plan_period_s);
  if (period == planned_period_) return;
  std::size_t own = radius_m_.size();
  const std::vector<motion::Explorer> robots = team(shared, frame.acquired_ns, own);
  if (own >= robots.size() || !robots[own].explores) return;
  planned_period_ = period;
  const motion::Exploration::Plan plan = exploration_.plan(shared.grid(), robots, own, failed_m_);
  frontiers_ = static_cast<std::uint32_t>(plan.frontiers.size());
  done_plans_ = plan.frontiers.empty() ? done_plans_ + 1 : 0;
  const std::optional<motion::Exploration::Goal> before = goal_;
  goal_ = plan.own;
  if (goal_ && goal_->exhausted) return skip(true);
  if (goal_ && (goal_->frontier.place_m - watched_m_).norm() > kSameGoalM) {
    watched_m_ = goal_->frontier.place_m;
    looking_s_ = since_progress_s_ = since_chosen_s_ = 0.0;
    least_left_s_ = kUnknownS;
    failed_m_.clear();
  }
  // From another viewpoint the way may be longer.
  if (goal_ && before && (goal_->viewpoint.cell - before->viewpoint.cell).norm() > kSameViewCells)
    least_left_s_ = kUnknownS;
  // Robots may have been in the way.
  if (plan.frontiers.empty() && !std::exchange(retried_, true))
    skipped_.erase(std::remove_if(skipped_.begin(), skipped_.end(), [](const auto& s) { return !s.looked; }),
                   skipped_.end());
}

Explorer::Drive Explorer::drive(const Frame& frame, const SharedGrid& shared) {
  choose(frame, shared);
  Drive drive;
  drive.explored = done_plans_ >= kDonePlans;
  if (!goal_) {
    if (!drive.explored) drive.twist = makeWay(frame, shared.grid());
    return drive;
  }
  drive.goal_m = goal_->frontier.place_m;
  drive.twist = approach(frame, shared.grid());
  if (!goal_) drive.goal_m.reset();
  return drive;
}

motion::Twist Explorer::turnTo(double off_rad) const {
  return {0.0,
          std::clamp(limits_.turn_gain_per_s * off_rad, -limits_.max_turn_radps, limits_.max_turn_radps)};
}

/// A robot that looks or waits turns slowly to and fro. Its rays meet edges at other places, and a simulated
/// run does not end while floor is unknown (world: at rest).
motion::Twist Explorer::sweep(const Frame& frame) const {
  const bool left = frame.acquired_ns / kSweep_ns % 2 == 0;
  return {0.0, left ? kSweep_radps : -kSweep_radps};
}

/// Along the path to the viewpoint; there, to its heading.
motion::Twist Explorer::approach(const Frame& frame, const motion::ExplorationGrid& grid) {
  const Eigen::Vector2d here_m = frame.map_from_base.translation();
  const Eigen::Vector2d there_m = grid.centreOf(goal_->viewpoint.cell);
  const Eigen::Vector2i here = grid.cellOf(here_m);
  const double look_rad = wrapAngle(goal_->viewpoint.heading_rad - frame.map_from_base.theta_rad);
  if (!grid.isInside(here)) return {};
  const bool there = (there_m - here_m).norm() <= options_.arrived_m || here == goal_->viewpoint.cell;
  if (there && !retreat_) {
    const bool looking = std::abs(look_rad) <= options_.arrived_rad;
    watch(frame, std::abs(look_rad) / limits_.max_turn_radps, looking);
    return looking ? sweep(frame) : turnTo(look_rad);
  }
  price_.create(grid.size());
  exploration_.priceCells(grid, here_m, radius_m_.at(robot_), frame.solids, price_);
  field_.from(price_, here);
  const bool blocked = !field_.reaches(goal_->viewpoint.cell);
  if (yields(frame, grid, blocked || frame.held)) return along(frame, grid, *retreat_);
  if (blocked) {
    watch(frame, least_left_s_, false);
    return sweep(frame);
  }
  const motion::Twist twist = along(frame, grid, goal_->viewpoint.cell);
  watch(frame, grid.cell_m() * static_cast<double>(field_.cost(goal_->viewpoint.cell)) / limits_.cruise_mps,
        false);
  return twist;
}

/// A robot without a goal makes way for one that has a goal nearby.
motion::Twist Explorer::makeWay(const Frame& frame, const motion::ExplorationGrid& grid) {
  const Eigen::Vector2i here = grid.cellOf(frame.map_from_base.translation());
  if (!grid.isInside(here)) return {};
  if (!retreat_ && !frame.nearest_goal_m) return sweep(frame);
  price_.create(grid.size());
  exploration_.priceCells(grid, frame.map_from_base.translation(), radius_m_.at(robot_), frame.solids,
                          price_);
  field_.from(price_, here);
  return yields(frame, grid, true) ? along(frame, grid, *retreat_) : sweep(frame);
}

/// Whether the robot makes way for another robot that is in its way. The later one by name does so first.
bool Explorer::yields(const Frame& frame, const motion::ExplorationGrid& grid, bool blocked) {
  retreat_s_ -= frame.dt_s;
  if (retreat_ && (retreat_s_ <= 0.0 || !field_.reaches(*retreat_))) retreat_.reset();
  if (retreat_) return true;
  blocked_s_ = blocked ? blocked_s_ + frame.dt_s : 0.0;
  if (!blocked || !frame.nearest_m) return false;
  const bool soon = frame.nearest_first || !goal_;
  if (blocked_s_ < (soon ? 1.0 : kFirstWaits) * options_.yield_s) return false;
  retreat_ = wayMade(frame, grid);
  retreat_s_ = kRetreatS;
  blocked_s_ = 0.0;
  return retreat_.has_value();
}

/// The reachable cell nearby that is farthest from the other robot and from where it goes.
std::optional<Eigen::Vector2i> Explorer::wayMade(const Frame& frame,
                                                 const motion::ExplorationGrid& grid) const {
  const auto apart = [&](const Eigen::Vector2d& place_m) {
    const double robot_m = (place_m - *frame.nearest_m).norm();
    return frame.nearest_goal_m ? std::min(robot_m, (place_m - *frame.nearest_goal_m).norm()) : robot_m;
  };
  std::optional<Eigen::Vector2i> best;
  double most_m = apart(frame.map_from_base.translation()) + grid.cell_m();
  const auto farthest = static_cast<float>(kRetreatM / grid.cell_m());
  for (int row = 0; row < grid.size().height; ++row) {
    for (int column = 0; column < grid.size().width; ++column) {
      const Eigen::Vector2i cell(column, row);
      const double apart_m = apart(grid.centreOf(cell));
      if (apart_m <= most_m || !(field_.cost(cell) <= farthest)) continue;
      most_m = apart_m;
      best = cell;
    }
  }
  return best;
}

/// Along the path to a cell.
motion::Twist Explorer::along(const Frame& frame, const motion::ExplorationGrid& grid,
                              const Eigen::Vector2i& goal) const {
  const std::vector<Eigen::Vector2i> path = field_.pathTo(goal);
  if (path.empty()) return {};
  const double way_m = grid.cell_m() * static_cast<double>(path.size());
  const Eigen::Vector2d ahead_m =
      frame.map_from_base.inverse() * carrot(frame.map_from_base.translation(), path, grid);
  const double off_rad = std::atan2(ahead_m.y(), ahead_m.x());
  motion::Twist twist = turnTo(off_rad);
  if (std::abs(off_rad) < options_.turn_in_place_rad) {
    const double ahead = std::cos(0.5 * M_PI * off_rad / options_.turn_in_place_rad);
    twist.forward_mps = limits_.cruise_mps * ahead * std::clamp(way_m / kSlowM, kSlowest, 1.0);
  }
  return twist;
}

/// The last place of the path, within some distance, that a straight line reaches over cells that cost no
/// more than the path before it.
Eigen::Vector2d Explorer::carrot(const Eigen::Vector2d& here_m, const std::vector<Eigen::Vector2i>& path,
                                 const motion::ExplorationGrid& grid) const {
  Eigen::Vector2d best_m = grid.centreOf(path.front());
  float most = 0.0f;
  for (std::size_t i = 0; i < path.size(); ++i) {
    const Eigen::Vector2d there_m = grid.centreOf(path[i]);
    most = std::max(most, price_(path[i].y(), path[i].x()));
    const double length_m = (there_m - here_m).norm();
    if (length_m > kCarrotM) break;
    const int samples = static_cast<int>(std::ceil(2.0 * length_m / grid.cell_m()));
    bool free = true;
    for (int k = 1; free && k < samples; ++k) {
      const Eigen::Vector2i cell = grid.cellOf(here_m + (there_m - here_m) * k / samples);
      free = cell == grid.cellOf(here_m) || price_(cell.y(), cell.x()) <= most;
    }
    if (free) best_m = there_m;
  }
  return best_m;
}

/// Gives the goal up if it stays unknown in full view, or if the robot makes no progress towards it.
void Explorer::watch(const Frame& frame, double left_s, bool looking) {
  since_chosen_s_ += frame.dt_s;
  since_progress_s_ += frame.dt_s;
  if (left_s < least_left_s_ - kProgressS) {
    least_left_s_ = left_s;
    since_progress_s_ = 0.0;
  }
  looking_s_ = looking ? looking_s_ + frame.dt_s : 0.0;
  if (looking_s_ >= options_.look_s) {
    looking_s_ = since_progress_s_ = 0.0;
    least_left_s_ = kUnknownS;
    failed_m_.push_back(frame.map_from_base.translation());
    if (failed_m_.size() >= kMostLooks) skip(true);
  } else if (since_progress_s_ >= options_.stuck_s || since_chosen_s_ >= options_.longest_s) {
    skip(false);
  }
}

void Explorer::skip(bool looked) {
  if (skipped_.size() == motion::SkippedFrontier::kMost) skipped_.erase(skipped_.begin());
  skipped_.push_back({goal_->frontier.place_m, looked});
  goal_.reset();
  watched_m_ = kNowhere_m;
}

}  // namespace omnifleet::formation
