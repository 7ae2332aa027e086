#include "rover_simulator.h"

#include <algorithm>
#include <cmath>

#include "motion/motion_guard.h"

namespace omnifleet::formation {
namespace {

constexpr int kInnerSteps = 20;

double towards(double from, double to, double most) {
  return from + std::clamp(to - from, -most, most);
}

}  // namespace

RoverSimulator::RoverSimulator(const BlockArena& arena, const std::string& formation_yaml, std::uint32_t seed,
                               const Options& options)
    : arena_(arena), options_(options), random_(seed + 77u), outline_m_(trackedRobot().outline()) {
  std::map<std::string, RobotBody> bodies;
  for (std::size_t i = 0; i < arena.robots.size(); ++i) {
    names_.push_back("r" + std::to_string(i + 1));
    bodies[names_.back()] = trackedRobot();
  }
  const auto read = Formation::Options::read(options::Section::parse(formation_yaml, "formation.yaml"));
  for (std::size_t i = 0; i < arena.driving; ++i) {
    formations_.push_back(std::make_unique<Formation>(names_[i], bodies, read));
    // The last parked robot publishes its pose, the others are known from the fleet file.
    std::map<std::string, Pose2> parked;
    for (std::size_t k = arena.driving; k + 1 < arena.robots.size(); ++k) parked[names_[k]] = arena.robots[k];
    formations_.back()->park(parked);
  }
  poses_ = before_ = arena.robots;
  speeds_.resize(arena.driving);
  commanded_.resize(arena.driving);
  next_.resize(arena.driving);
  states_.resize(arena.driving);
}

/// As measured with forward cameras 8.5 cm above the floor.
double RoverSimulator::sigma(double range_m) const {
  return std::max(0.0009, 0.009 * range_m * range_m * std::max(1.0, range_m));
}

Objects RoverSimulator::observe(std::size_t robot) {
  Objects objects;
  objects.robot = names_[robot];
  objects.acquired_ns = static_cast<TimeNs>(std::llround(1e9 * time_s()));
  objects.sequence = static_cast<std::uint32_t>(frame_);
  Scan& scan = objects.scan;
  scan.origin_m = {options_.camera_x_m, 0.0};
  scan.blind_m = options_.blind_m;
  const auto n = static_cast<std::size_t>(options_.rays);
  scan.range_m.assign(n, 0.0f);
  scan.sigma_m.assign(n, 0.0f);
  scan.label.assign(n, RayLabel::kInvalid);
  scan.object.assign(n, 0);
  const Eigen::Vector2d from_m = poses_[robot] * scan.origin_m;
  const bool labelled = std::uniform_real_distribution<double>()(random_) >= options_.unlabelled_robots;
  for (std::size_t i = 0; i < n; ++i) {
    const double bearing_rad = wrapAngle(2.0 * M_PI * static_cast<double>(i) / options_.rays);
    if (std::abs(bearing_rad) > 0.5 * options_.view_deg * M_PI / 180.0 + 1e-9) continue;
    const double heading_rad = poses_[robot].theta_rad + bearing_rad;
    const Eigen::Vector2d unit(std::cos(heading_rad), std::sin(heading_rad));
    double range_m = arena_.range(from_m, unit, options_.range_m);
    RayLabel label = range_m < options_.range_m ? RayLabel::kObstacle : RayLabel::kFloorEnd;
    for (std::size_t k = 0; k < poses_.size(); ++k) {
      if (k == robot) continue;
      const double to_robot_m = rangeTo(motion::placed(poses_[k], outline_m_), from_m, unit, range_m);
      if (to_robot_m >= range_m) continue;
      range_m = to_robot_m;
      label = labelled ? RayLabel::kRobot : RayLabel::kUnknown;
    }
    const double sigma_m = sigma(range_m);
    if (label != RayLabel::kFloorEnd) range_m = std::max(0.01, range_m + sigma_m * normal());
    scan.range_m[i] = static_cast<float>(std::max(range_m, options_.blind_m));
    scan.sigma_m[i] = static_cast<float>(sigma_m);
    scan.label[i] = label;
  }
  if (frame_ == 0) return objects;
  objects.motion.valid = true;
  objects.motion.since_ns = static_cast<TimeNs>(std::llround(1e9 * (frame_ - 1) / options_.rate_hz));
  Pose2 step = before_[robot].inverse() * poses_[robot];
  for (double* value : {&step.x_m, &step.y_m, &step.theta_rad})
    *value *= 1.0 + options_.wheel_noise * normal();
  objects.motion.previous_from_current = step;
  return objects;
}

void RoverSimulator::step() {
  std::vector<motion::FormationState> published;
  for (std::size_t i = 0; i < arena_.driving; ++i) {
    std::vector<motion::FormationState> received;
    for (const motion::FormationState& state : received_) {
      const bool lost = std::uniform_real_distribution<double>()(random_) < options_.lost_states;
      if (state.robot != names_[i] && !lost) received.push_back(state);
    }
    const Formation::Output output = formations_[i]->process(observe(i), published_, received);
    commanded_[i] = next_[i];
    next_[i] = output.command.speeds;
    states_[i] = output.state;
    published.push_back(output.state);
  }
  received_ = std::move(published);
  published_.clear();
  for (std::size_t i = 0; i < poses_.size(); ++i) {
    if (i >= arena_.driving && i + 1 < poses_.size()) continue;
    PoseEstimate pose;
    pose.robot = names_[i];
    pose.acquired_ns = static_cast<TimeNs>(std::llround(1e9 * time_s()));
    pose.valid = true;
    pose.map_from_base = {poses_[i].x_m + options_.pose_sigma_m * normal(),
                          poses_[i].y_m + options_.pose_sigma_m * normal(),
                          poses_[i].theta_rad + options_.pose_sigma_rad * normal()};
    published_.push_back(pose);
  }
  drive();
  ++frame_;
}

/// The commands of the frame before are executed until the next frame.
void RoverSimulator::drive() {
  before_ = poses_;
  const double dt_s = 1.0 / options_.rate_hz / kInnerSteps;
  for (int inner = 0; inner < kInnerSteps; ++inner) {
    for (std::size_t i = 0; i < arena_.driving; ++i) {
      motion::WheelSpeeds& speeds = speeds_[i];
      speeds = {towards(speeds.left_mps, commanded_[i].left_mps, options_.max_wheel_mps2 * dt_s),
                towards(speeds.right_mps, commanded_[i].right_mps, options_.max_wheel_mps2 * dt_s)};
      poses_[i] = poses_[i] * motion::rolled(speeds.left_mps * dt_s, speeds.right_mps * dt_s,
                                             trackedRobot().wheel_separation_m, motion::Integration::kArc);
    }
    if (inner % 4 != 3) continue;
    for (std::size_t i = 0; i < arena_.driving; ++i) {
      const Polygon outline = motion::placed(poses_[i], outline_m_);
      least_gap_m_ = std::min(least_gap_m_, arena_.distanceToBlocks(outline));
      for (std::size_t k = 0; k < poses_.size(); ++k) {
        if (k == i) continue;
        least_gap_m_ =
            std::min(least_gap_m_, motion::distanceBetween(outline, motion::placed(poses_[k], outline_m_)));
      }
    }
  }
}

bool RoverSimulator::allArrived() const {
  return std::all_of(states_.begin(), states_.end(), [](const auto& state) { return state.arrived; });
}

}  // namespace omnifleet::formation
