#include "fleet_simulator.h"

#include <Eigen/Dense>
#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "estimation/factors.h"
#include "evaluation/consistency.h"

namespace omnifleet::estimation::testing {
namespace {

constexpr double kSeparation_m = 0.26;
constexpr int kCircle = 240;  // corners of a round body: 0.013 mm of 15 cm

/// White noise over K directions, smoothed so that neighbours share their error as they share contour points.
std::vector<double> correlatedNoise(std::mt19937& random, int k) {
  std::normal_distribution<double> unit(0.0, 1.0);
  std::vector<double> white(static_cast<std::size_t>(k)), smooth(white.size());
  for (double& w : white) w = unit(random);
  for (std::size_t i = 0; i < white.size(); ++i) {
    const std::size_t before = (i + white.size() - 1) % white.size(), after = (i + 1) % white.size();
    smooth[i] = (white[before] + white[i] + white[after]) / std::sqrt(3.0);
  }
  return smooth;
}

bool crosses(const Eigen::Vector2d& p, const std::vector<Prism>& prisms, double clearance) {
  return std::any_of(prisms.begin(), prisms.end(),
                     [&](const Prism& prism) { return (p - prism.centre_m).norm() < clearance; });
}

}  // namespace

double Prism::support(const Eigen::Vector2d& n) const {
  if (radius_m > 0) return n.dot(centre_m) + radius_m;
  double best = -1e9;
  for (const auto& p : outline_m) best = std::max(best, n.dot(p));
  return best;
}

FleetSimulator::FleetSimulator(const SimulationOptions& options, std::uint32_t seed)
    : options_(options), seed_(seed), random_(seed) {
  body.radius_m = 0.15;
  body.height_m = 0.3;
  body.wheel_separation_m = kSeparation_m;
  for (int r = 0; r < options_.robots; ++r) {
    const double left = gauss(options_.wheel_bias_sigma);
    bias_.emplace_back(left, gauss(options_.wheel_bias_sigma));
  }
  std::mt19937 calibration(seed + 77);
  std::normal_distribution<double> unit(0.0, 1.0);
  for (int r = 0; r < options_.robots; ++r) {
    Eigen::Vector4d error;
    for (int i = 0; i < 4; ++i) error(i) = options_.camera_sigma(i) * unit(calibration);
    error(1) += options_.height_error;
    camera_.push_back(error);
  }
  placeObstacles();
  while (!drive()) continue;
}

void FleetSimulator::placeObstacles() {
  std::uniform_real_distribution<double> place(-1.8, 1.8), size(0.07, 0.16), height(0.08, 0.3),
      angle(0, M_PI);
  while (static_cast<int>(obstacles_.size()) < options_.obstacles) {
    Prism prism;
    const double x = place(random_), y = place(random_);
    prism.centre_m = {x, y};
    prism.height_m = height(random_);
    const double a = size(random_), b = size(random_), turn = angle(random_);
    if (crosses(prism.centre_m, obstacles_, 0.6)) continue;
    if (options_.equal_discs) {
      prism.radius_m = 0.12;
      prism.height_m = 0.2;
    } else if (obstacles_.size() % 2 == 0) {
      const Pose2 at{x, y, turn};
      prism.outline_m = {at * Eigen::Vector2d(-a, -b), at * Eigen::Vector2d(a, -b),
                         at * Eigen::Vector2d(a, b), at * Eigen::Vector2d(-a, b)};
    } else {
      prism.radius_m = a;
    }
    obstacles_.push_back(std::move(prism));
  }
}

/// @return false if kidnapping all robots together would place one in an obstacle
bool FleetSimulator::drive() {
  std::uniform_real_distribution<double> place(-1.5, 1.5), heading(-M_PI, M_PI), curve(-0.8, 0.8);
  truth_.assign(static_cast<std::size_t>(options_.robots), {});
  rolled_.assign(truth_.size(), {});
  const double common_rad = options_.all_kidnapped ? heading(random_) : 0.0;
  for (std::size_t r = 0; r < truth_.size(); ++r) {
    Pose2 at;
    const auto blocked = [&](const Pose2& p, std::size_t frame) {
      if (crosses(p.translation(), obstacles_, 0.38)) return true;
      for (std::size_t other = 0; other < r; ++other) {
        const Pose2& there = truth_[other][std::min(frame, truth_[other].size() - 1)];
        if ((there.translation() - p.translation()).norm() < 0.45) return true;
      }
      return std::abs(p.x_m) > 1.9 || std::abs(p.y_m) > 1.9;
    };
    do {
      const double x = place(random_), y = place(random_);
      at = {x, y, heading(random_)};
    } while (blocked(at, 0));
    double turn = 0.0;
    for (int f = 0; f < options_.frames; ++f) {
      truth_[r].push_back(at);
      if (f % 8 == 0) turn = curve(random_);
      const double way = options_.speed_mps * options_.period_s;
      const Pose2 ahead = at * Pose2{3.0 * way, 0.0, 0.0};
      // Blocked: turn on the spot, always in the same direction.
      const bool stop = blocked(ahead, static_cast<std::size_t>(f + 1)) ||
                        blocked(at * Pose2{way, 0, 0}, static_cast<std::size_t>(f + 1));
      const double half = 0.5 * kSeparation_m * (stop ? 1.2 : turn) * options_.period_s;
      const double forward = stop ? 0.0 : way;
      rolled_[r].emplace_back(forward - half, forward + half);
      at = at * arc(forward - half, forward + half, kSeparation_m);
      if (options_.kidnapped_at == 0 || f + 1 != options_.kidnapped_at || (r != 0 && !options_.all_kidnapped))
        continue;
      const Pose2 before = at;
      if (options_.all_kidnapped) {
        at = kidnapped(before, common_rad);
        if (blocked(at, static_cast<std::size_t>(f + 1))) return false;
        continue;
      }
      do {
        at = kidnapped(before, heading(random_));
      } while (blocked(at, static_cast<std::size_t>(f + 1)));
    }
  }
  return true;
}

Pose2 FleetSimulator::kidnapped(const Pose2& before, double direction_rad) const {
  const Eigen::Vector2d by_m =
      options_.kidnapped_m * Eigen::Vector2d(std::cos(direction_rad), std::sin(direction_rad));
  Pose2 at = options_.all_kidnapped ? Pose2{by_m.x(), by_m.y(), 0.0} * before
                                    : before * Pose2{by_m.x(), by_m.y(), 0.0};
  at.theta_rad = wrapAngle(at.theta_rad + options_.kidnapped_rad);
  return at;
}

std::vector<RobotSetup> FleetSimulator::setups() const {
  std::vector<RobotSetup> all;
  std::mt19937 start(seed_ + 12345);
  for (int r = 0; r < options_.robots; ++r) {
    RobotSetup setup;
    setup.name = name(r);
    setup.body = body;
    setup.lens = lens::Spread(options_.orthographic ? 1.0 : 0.0);
    std::normal_distribution<double> unit(0.0, 1.0);
    const double ex = unit(start) * options_.initial_sigma_m, ey = unit(start) * options_.initial_sigma_m;
    setup.initial_pose = truth(r, 0) * Pose2{ex, ey, unit(start) * options_.initial_sigma_rad};
    all.push_back(setup);
  }
  return all;
}

TimeNs FleetSimulator::time(int frame) const {
  return 1000000000000LL + static_cast<TimeNs>(frame) * static_cast<TimeNs>(options_.period_s * 1e9);
}

const Pose2& FleetSimulator::truth(int robot, int frame) const {
  return truth_[static_cast<std::size_t>(robot)][static_cast<std::size_t>(frame)];
}

Motion FleetSimulator::wheels(int robot, int frame) {
  Motion motion;
  if (frame == 0 || !options_.wheels) return motion;
  const Eigen::Vector2d rolled =
      rolled_[static_cast<std::size_t>(robot)][static_cast<std::size_t>(frame - 1)];
  const auto measured = [&](double travel, double bias) {
    return travel / (1.0 + bias) + gauss(options_.wheel_noise * std::abs(travel) + 1e-5);
  };
  motion.valid = true;
  motion.since_ns = time(frame - 1);
  motion.left_m = measured(rolled.x(), bias(robot).x());
  motion.right_m = measured(rolled.y(), bias(robot).y());
  motion.previous_from_current = arc(motion.left_m, motion.right_m, kSeparation_m);
  // First-order noise of the two wheels in the end frame.
  const double left = options_.wheel_noise * std::abs(motion.left_m) + 1e-5;
  const double right = options_.wheel_noise * std::abs(motion.right_m) + 1e-5;
  Eigen::Matrix<double, 3, 2> by_wheels;
  by_wheels << 0.5, 0.5, 0.0, 0.0, -1.0 / kSeparation_m, 1.0 / kSeparation_m;
  motion.covariance =
      by_wheels * Eigen::Vector2d(left * left, right * right).asDiagonal() * by_wheels.transpose();
  motion.covariance.diagonal().array() += 1e-8;
  return motion;
}

double FleetSimulator::radiusOf(double theta_rad) const {
  return options_.orthographic ? std::sin(theta_rad) : theta_rad;
}
double FleetSimulator::angleOf(double radius) const {
  return options_.orthographic ? std::asin(std::min(1.0, radius)) : radius;
}

/// Floor point that the calibrated camera estimates for a true floor point, both relative to its foot.
Eigen::Vector2d FleetSimulator::throughCamera(int robot, const Eigen::Vector2d& floor_m) const {
  const Eigen::Vector4d& error = cameraError(robot);
  const Eigen::Vector3d ray =
      Eigen::Vector3d(floor_m.x(), floor_m.y(), -options_.camera_height_m).normalized();
  const Eigen::Matrix3d calibrated_from_real = (Eigen::AngleAxisd(error(3), Eigen::Vector3d::UnitY()) *
                                                Eigen::AngleAxisd(error(2), Eigen::Vector3d::UnitX()))
                                                   .toRotationMatrix();
  const double calibrated_rad = angleOf(radiusOf(std::acos(-ray.z())) / (1.0 + error(0)));
  const Eigen::Vector2d away = ray.head<2>().normalized();
  const Eigen::Vector3d bent(away.x() * std::sin(calibrated_rad), away.y() * std::sin(calibrated_rad),
                             -std::cos(calibrated_rad));
  const Eigen::Vector3d seen = calibrated_from_real * bent;
  return options_.camera_height_m * (1.0 + error(1)) / -seen.z() * seen.head<2>();
}

/// Replaces every floor point by a circle about it in the image of a lens of focal length 1.
void FleetSimulator::enlarge(std::vector<Eigen::Vector2d>& points) const {
  const double by_rad = options_.outline_bias_rad, height_m = options_.camera_height_m;
  constexpr int kAround = 64;
  std::vector<Eigen::Vector2d> enlarged;
  for (const Eigen::Vector2d& p : points) {
    const Eigen::Vector2d pixel = radiusOf(std::atan(p.norm() / height_m)) * p.normalized();
    for (int i = 0; i < kAround; ++i) {
      const double a = 2.0 * M_PI * i / kAround;
      const Eigen::Vector2d at = pixel + by_rad * Eigen::Vector2d(std::cos(a), std::sin(a));
      if (at.norm() < radiusOf(0.5 * M_PI - 0.01))
        enlarged.emplace_back(height_m * std::tan(angleOf(at.norm())) * at.normalized());
    }
  }
  points = std::move(enlarged);
}

Track FleetSimulator::observe(int robot, int frame, const Prism& prism, std::uint32_t id, ObjectKind kind) {
  constexpr int kDirections = SupportFunction::kDirections;
  const Pose2& at = truth(robot, frame);
  const double h_camera = options_.camera_height_m, s = h_camera / (h_camera - prism.height_m);
  Track track;
  track.id = id;
  track.kind = kind;
  track.visible = true;
  track.kind_probability = 0.9;
  const std::vector<double> noise = correlatedNoise(random_, kDirections);
  double nearest = 1e9;
  std::vector<Eigen::Vector2d> seen;  // of the floor and the top outline, base_link
  seen.assign(prism.outline_m.begin(), prism.outline_m.end());
  for (int i = 0; prism.radius_m > 0 && i < kCircle; ++i) {
    const double phi = 2.0 * M_PI * i / kCircle;
    seen.emplace_back(prism.centre_m + prism.radius_m * Eigen::Vector2d(std::cos(phi), std::sin(phi)));
  }
  const std::size_t corners = seen.size();
  for (std::size_t i = 0; i < corners; ++i) {
    const Eigen::Vector2d floor = at.inverse() * seen[i];
    if (options_.shadow_m > 0)
      seen.push_back(
          throughCamera(robot, at.inverse() * Eigen::Vector2d(seen[i].x(), seen[i].y() - options_.shadow_m)));
    seen[i] = throughCamera(robot, floor);
    seen.push_back(throughCamera(robot, s * floor));
  }
  if (options_.outline_bias_rad > 0) enlarge(seen);
  for (int k = 0; k < kDirections; ++k) {
    const double phi = 2.0 * M_PI * k / kDirections, psi = phi + at.theta_rad;
    const Eigen::Vector2d n(std::cos(psi), std::sin(psi));
    const double g = prism.support(n) - n.dot(at.translation());
    double b = -1e9;
    for (const auto& p : seen) b = std::max(b, p.dot(Eigen::Vector2d(std::cos(phi), std::sin(phi))));
    nearest = std::min(nearest, std::abs(g));
    // The supporting point's distance: along n at least |b|; across, the footprint's own bearing.
    const double across = Eigen::Vector2d(-n.y(), n.x()).dot(prism.centre_m - at.translation());
    const double rho2 = b * b + across * across * (g > 0 ? s * s : 1.0);
    const double slope = options_.orthographic ? h_camera / std::sqrt(h_camera * h_camera + rho2) : 1.0;
    const double per_px = (h_camera * h_camera + rho2) / h_camera / options_.focal_px / slope;
    const double sigma = options_.pixel_sigma_px * per_px + 0.001;
    const double noise_m = options_.pixel_sigma_px * per_px * noise[static_cast<std::size_t>(k)];
    track.supports.b_m.push_back(static_cast<float>(b + noise_m));
    track.supports.sigma_m.push_back(static_cast<float>(sigma));
  }
  track.position_m = at.inverse() * prism.centre_m;
  const double radius = prism.radius_m > 0 ? prism.radius_m : 0.12;
  track.contact_m = track.position_m * std::max(0.0, 1.0 - radius / std::max(1e-6, track.position_m.norm()));
  return track;
}

std::vector<Objects> FleetSimulator::frames(int frame) {
  std::vector<Objects> all;
  for (int r = 0; r < options_.robots; ++r) {
    Objects objects;
    objects.robot = name(r);
    objects.acquired_ns = time(frame);
    objects.sequence = static_cast<std::uint32_t>(frame);
    objects.camera_height_m = options_.camera_height_m * (1.0 + cameraError(r)(1));
    objects.motion = wheels(r, frame);
    const Eigen::Vector2d here = truth(r, frame).translation();
    for (std::size_t o = 0; o < obstacles_.size() && options_.obstacles_seen; ++o) {
      if ((obstacles_[o].centre_m - here).norm() > options_.sight_m) continue;
      objects.tracks.push_back(
          observe(r, frame, obstacles_[o], static_cast<std::uint32_t>(o + 1), ObjectKind::kObstacle));
    }
    for (int other = 0; other < options_.robots && options_.robots_seen; ++other) {
      Prism peer;
      peer.centre_m = truth(other, frame).translation();
      peer.radius_m = body.radius_m;
      peer.height_m = body.height_m;
      if (other == r || (peer.centre_m - here).norm() > options_.sight_m) continue;
      objects.tracks.push_back(
          observe(r, frame, peer, static_cast<std::uint32_t>(100 + other), ObjectKind::kRobot));
    }
    all.push_back(std::move(objects));
  }
  return all;
}

std::vector<const Objects*> pointers(const std::vector<Objects>& frames) {
  std::vector<const Objects*> all;
  for (const Objects& frame : frames) all.push_back(&frame);
  return all;
}

RunResult run(const SimulationOptions& simulation, EstimatorOptions options, std::uint32_t seed) {
  FleetSimulator simulator(simulation, seed);
  if (simulation.initial_sigma_m <= 0) {  // exact initial poses have a small σ
    options.initial_sigma_m = 1e-4;
    options.initial_sigma_rad = 1e-4;
  }
  FleetEstimator estimator(simulator.setups(), options);
  RunResult result;
  for (int f = 0; f < simulation.frames; ++f) {
    const std::vector<Objects> frames = simulator.frames(f);
    const auto estimates = estimator.process(simulator.time(f), pointers(frames), {});
    for (std::size_t r = 0; r < estimates.size(); ++r) {
      ++result.frames;
      if (!estimates[r].valid) continue;
      const Pose2 e = estimates[r].map_from_base.inverse() * simulator.truth(static_cast<int>(r), f);
      const double distance = e.translation().norm();
      result.mean_m += distance;
      result.worst_m = std::max(result.worst_m, distance);
      result.mean_rad += std::abs(e.theta_rad);
      result.nees += evaluation::normalisedSquare(estimates[r].map_from_base, estimates[r].covariance,
                                                  simulator.truth(static_cast<int>(r), f));
      result.heading_nees += e.theta_rad * e.theta_rad / estimates[r].covariance(2, 2);
      ++result.estimates;
    }
  }
  const double n = std::max(1, result.estimates);
  result.mean_m /= n;
  result.mean_rad /= n;
  result.nees /= n;
  result.heading_nees /= n;
  for (int r = 0; r < simulation.robots; ++r) {
    const Eigen::Vector4d off =
        estimator.cameraError(FleetSimulator::name(r)).head<4>() - simulator.cameraError(r);
    result.camera += off.cwiseAbs2() / simulation.robots;
  }
  result.camera = result.camera.cwiseSqrt();
  for (const LandmarkEstimate& landmark : estimator.landmarks()) {
    double nearest = 1e9;
    for (const Prism& prism : simulator.obstacles()) {
      nearest = std::min(nearest, (prism.centre_m - landmark.centre_m).norm());
    }
    result.landmark_m += nearest;
    ++result.landmarks;
  }
  result.landmark_m /= std::max(1, result.landmarks);
  return result;
}

}  // namespace omnifleet::estimation::testing
