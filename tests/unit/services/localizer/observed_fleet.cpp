#include "observed_fleet.h"

#include <cmath>
#include <random>

#include "dataset/writer.h"

namespace omnifleet::localizer::testing {
namespace {

constexpr double kSeparation_m = 0.26, kArea_m = 3.0;
constexpr TimeNs kStart_ns = 1'000'000'000'000;
constexpr int kSubsteps = 5;

TimeNs timeAt(double seconds) {
  return kStart_ns + static_cast<TimeNs>(std::llround(seconds * 1e9));
}

/// Drives circles that drift. There is no feedback from the pose: a correction of the path after a slip would
/// follow the slip in time and look like a delay.
struct Driver {
  Pose2 pose;
  double phase_rad, speed_mps;
  double rate(double time_s) const { return 0.25 + 0.2 * std::sin(0.5 * time_s + 2.0 * phase_rad); }
};

}  // namespace

ObservedFleet::ObservedFleet(const ObservedFleetOptions& o, std::uint32_t seed) {
  std::mt19937 random(seed);
  const auto gauss = [&](double sigma) { return std::normal_distribution<double>(0.0, 1.0)(random) * sigma; };
  const auto uniform = [&](double a, double b) {
    return std::uniform_real_distribution<double>(a, b)(random);
  };
  for (int i = 0; i < o.landmarks; ++i) {
    const double phi = 2.0 * M_PI * i / o.landmarks, r = i % 3 == 0 ? 0.6 * kArea_m : kArea_m;
    const Eigen::Vector2d p(r * std::cos(phi) + uniform(-0.3, 0.3), r * std::sin(phi) + uniform(-0.3, 0.3));
    recording.landmarks.push_back({"m" + std::to_string(i), p, 0.005});
    dataset::MapObject object;
    object.id = static_cast<std::uint64_t>(i);
    object.name = recording.landmarks.back().name;
    object.centroid_m = p;
    object.outline_m = {p + Eigen::Vector2d(-0.05, -0.05), p + Eigen::Vector2d(0.05, -0.05),
                        p + Eigen::Vector2d(0.05, 0.05), p + Eigen::Vector2d(-0.05, 0.05)};
    scene.push_back(object);
  }
  std::vector<Driver> drivers;
  std::vector<Eigen::Vector3d> errors;  // left, right, turn
  for (int r = 0; r < o.robots; ++r) {
    const double phi = 2.0 * M_PI * r / o.robots;
    drivers.push_back(
        {{1.2 * std::cos(phi), 1.2 * std::sin(phi), uniform(-3.0, 3.0)}, phi, uniform(0.12, 0.2)});
    errors.emplace_back(gauss(o.wheel_sigma), gauss(o.wheel_sigma), gauss(o.turn_sigma));
    dataset::RobotRecording robot;
    robot.name = "r" + std::to_string(r + 1);
    robot.body = {0.15, {}, 0.3, kSeparation_m};
    if (o.initial_poses) robot.initial_pose = drivers.back().pose;
    recording.robots.push_back(robot);
  }
  const int ticks = static_cast<int>(o.duration_s * o.wheel_rate_hz);
  const double dt = 1.0 / o.wheel_rate_hz;
  const int per_report = static_cast<int>(std::lround(o.wheel_rate_hz / o.rate_hz));
  bool kidnapped = false;
  for (int tick = 0; tick <= ticks; ++tick) {
    const double now = tick * dt;
    if (o.kidnapped_s >= 0 && now >= o.kidnapped_s && !kidnapped) {
      Pose2& pose = drivers[0].pose;
      pose = {pose.x_m > 0 ? pose.x_m - 2.0 : pose.x_m + 2.0, pose.y_m, wrapAngle(pose.theta_rad + 2.0)};
      kidnapped = true;
    }
    for (std::size_t r = 0; r < drivers.size(); ++r) {
      auto& robot = recording.robots[r];
      truth[robot.name].push_back({timeAt(now), drivers[r].pose});
      // Each robot reports at times of its own.
      if ((tick + 2 * static_cast<int>(r)) % per_report != 0 || tick < per_report) continue;
      const auto report = [&](const std::string& id, const Eigen::Vector2d& target) {
        const Eigen::Vector2d at = drivers[r].pose.inverse() * target - Eigen::Vector2d(o.mounting_m, 0.0);
        const double beta = std::atan2(at.y(), at.x()), range = at.norm();
        if (range > o.sight_m || std::abs(beta) > o.half_view_rad || range < 0.3) return;
        const double measured = range * (1.0 - o.obliqueness * (1.0 - std::cos(beta - o.axis_rad)));
        const bool wrong = uniform(0.0, 1.0) < o.outliers;
        const auto other = static_cast<std::size_t>(uniform(0.0, o.landmarks - 0.001));
        robot.observations.push_back({timeAt(now + o.lag_s), wrong ? recording.landmarks[other].name : id,
                                      measured + gauss(o.range_sigma_m + o.range_sigma_per_m * range),
                                      beta + o.bearing_bias_rad + gauss(o.bearing_sigma_rad)});
      };
      for (const auto& landmark : recording.landmarks) report(landmark.name, landmark.position_m);
      for (std::size_t other = 0; other < drivers.size(); ++other) {
        if (other != r) report(recording.robots[other].name, drivers[other].pose.translation());
      }
    }
    for (std::size_t r = 0; r < drivers.size(); ++r) {
      // The true motion is that of the wheels plus an error that they do not measure.
      const double rate = drivers[r].rate(now), speed = drivers[r].speed_mps;
      const double slip = gauss((o.turn_walk + o.turn_walk_turning * std::abs(rate)) / std::sqrt(dt));
      const Eigen::Vector3d& e = errors[r];
      const double half = 0.5 * rate / (1.0 + e.z()) * kSeparation_m;
      recording.robots[r].wheels.push_back(
          {timeAt(now - o.delay_s), (speed - half) / (1.0 + e.x()), (speed + half) / (1.0 + e.y())});
      for (int s = 0; s < kSubsteps; ++s) {
        Pose2& pose = drivers[r].pose;
        const double h = dt / kSubsteps, mid = pose.theta_rad + 0.5 * (rate + slip) * h;
        pose = {pose.x_m + speed * h * std::cos(mid), pose.y_m + speed * h * std::sin(mid),
                wrapAngle(pose.theta_rad + (rate + slip) * h)};
      }
    }
  }
}

void ObservedFleet::write(const std::string& folder, bool survey) const {
  dataset::writeDatasetYaml(folder, recording.robots);
  for (const auto& robot : recording.robots) {
    dataset::WheelsWriter wheels(folder, robot.name);
    for (const auto& row : robot.wheels) wheels.write(row);
    dataset::ObservationsWriter observations(folder, robot.name);
    for (const auto& row : robot.observations) observations.write(row);
    dataset::writeTruthTrajectory(folder, robot.name, truth.at(robot.name));
  }
  dataset::writeTruthScene(folder, scene);
  if (survey) dataset::writeLandmarks(folder + "/landmarks.yaml", recording.landmarks);
}

}  // namespace omnifleet::localizer::testing
