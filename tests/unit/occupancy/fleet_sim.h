#pragma once

// An analytic fleet for the tests of the map: boxes on a floor and robots on given paths. Each robot sees the
// floor contact of what is around it (ray casting against polygons, closed form) and the supports of its
// silhouettes.

#include <cmath>
#include <functional>
#include <map>
#include <optional>
#include <random>
#include <string>
#include <vector>

#include "observation/observation.h"
#include "outline/prism.h"

namespace omnifleet::testing {

inline constexpr double kCameraHeightM = 0.5;

inline Polygon boxPolygon(const Eigen::Vector2d& centre, double length_m, double width_m, double turn_rad) {
  const Eigen::Rotation2Dd turn(turn_rad);
  Polygon corners;
  for (const auto& [x, y] : {std::pair{-1, -1}, {1, -1}, {1, 1}, {-1, 1}}) {
    corners.push_back(centre + turn * Eigen::Vector2d(0.5 * x * length_m, 0.5 * y * width_m));
  }
  return corners;
}

/// Distance along a ray (origin, unit direction) to a polygon; nothing if the ray misses it.
inline std::optional<double> rayDistance(const Eigen::Vector2d& origin, const Eigen::Vector2d& direction,
                                         const Polygon& polygon) {
  std::optional<double> nearest;
  for (std::size_t i = 0; i < polygon.size(); ++i) {
    const Eigen::Vector2d a = polygon[i], edge = polygon[(i + 1) % polygon.size()] - a, to = a - origin;
    const double turn = direction.x() * edge.y() - direction.y() * edge.x();
    if (std::abs(turn) < 1e-12) continue;
    const double along = (to.x() * edge.y() - to.y() * edge.x()) / turn;
    const double on_edge = (to.x() * direction.y() - to.y() * direction.x()) / turn;
    if (along > 0 && on_edge >= 0 && on_edge <= 1 && (!nearest || along < *nearest)) nearest = along;
  }
  return nearest;
}

struct SimObstacle {
  Polygon footprint_m;
  double height_m = 0.2;
  std::uint16_t track = 0;
  ObjectKind kind = ObjectKind::kObstacle;
};

struct SimRobot {
  std::string name;
  std::function<Pose2(double time_s)> path;
};

struct SimOptions {
  int rays = 360;
  double range_m = 3.0;
  double range_noise_m = 0.0;
  double support_noise = 0.0;  ///< in σ of 0.4 px and 1 mm at 1 m from a 960 px lens
  double pose_noise_m = 0.0;
  ObjectKind robots_are = ObjectKind::kRobot;  ///< kind that the classifier reports for the other robots
};

class FleetSim {
 public:
  FleetSim(std::vector<SimObstacle> obstacles, std::vector<SimRobot> robots, SimOptions options,
           unsigned seed = 1)
      : obstacles_(std::move(obstacles)), robots_(std::move(robots)), options_(options), random_(seed) {
    std::uint16_t track = 1;
    for (auto& obstacle : obstacles_) obstacle.track = track++;
  }

  struct Frame {
    Objects objects;
    PoseEstimate pose;
  };

  std::vector<SimObstacle>& obstacles() { return obstacles_; }
  const RobotBody& body() const { return body_; }
  std::map<std::string, RobotBody> bodies() const {
    std::map<std::string, RobotBody> all;
    for (const auto& robot : robots_) all[robot.name] = body_;
    return all;
  }

  /// Frames of all robots at a time, in the order of the robots.
  std::vector<Frame> at(double time_s) {
    std::vector<Frame> frames;
    for (const auto& robot : robots_) frames.push_back(frameOf(robot, time_s));
    return frames;
  }

 private:
  std::vector<SimObstacle> around(const SimRobot& self, double time_s) const {
    std::vector<SimObstacle> all = obstacles_;
    std::uint16_t track = 100;
    for (const auto& robot : robots_) {
      ++track;
      if (robot.name == self.name) continue;
      all.push_back({circlePolygon(robot.path(time_s).translation(), body_.radius_m, 48), body_.height_m,
                     track, options_.robots_are});
    }
    return all;
  }

  Frame frameOf(const SimRobot& robot, double time_s) {
    std::normal_distribution<double> normal;
    Frame frame;
    const Pose2 truth = robot.path(time_s);
    auto& objects = frame.objects;
    objects.robot = frame.pose.robot = robot.name;
    objects.acquired_ns = frame.pose.acquired_ns = static_cast<TimeNs>(std::llround(time_s * 1e9));
    objects.camera_height_m = kCameraHeightM;
    const auto all = around(robot, time_s);
    castScan(all, truth, objects.scan);
    for (const auto& obstacle : all) addTrack(obstacle, truth, objects);
    frame.pose.valid = true;
    frame.pose.map_from_base = {truth.x_m + options_.pose_noise_m * normal(random_),
                                truth.y_m + options_.pose_noise_m * normal(random_),
                                truth.theta_rad + options_.pose_noise_m * normal(random_)};
    frame.pose.covariance *= 1e-5;
    return frame;
  }

  void castScan(const std::vector<SimObstacle>& all, const Pose2& truth, Scan& scan) {
    std::normal_distribution<double> normal;
    for (int i = 0; i < options_.rays; ++i) {
      const double bearing = truth.theta_rad + 2.0 * M_PI * i / options_.rays;
      double range = options_.range_m;
      RayLabel label = RayLabel::kFloorEnd;
      std::uint16_t track = 0;
      for (const auto& obstacle : all) {
        const auto hit =
            rayDistance(truth.translation(), {std::cos(bearing), std::sin(bearing)}, obstacle.footprint_m);
        if (!hit || *hit >= range) continue;
        range = *hit;
        track = obstacle.track;
        label = obstacle.kind == ObjectKind::kRobot      ? RayLabel::kRobot
                : obstacle.kind == ObjectKind::kObstacle ? RayLabel::kObstacle
                                                         : RayLabel::kUnknown;
      }
      if (track != 0) range += options_.range_noise_m * normal(random_);
      scan.range_m.push_back(static_cast<float>(range));
      scan.sigma_m.push_back(0.005F);
      scan.label.push_back(label);
      scan.object.push_back(track);
    }
  }

  void addTrack(const SimObstacle& obstacle, const Pose2& truth, Objects& objects) {
    const double distance = (centroid(obstacle.footprint_m) - truth.translation()).norm();
    if (distance > 2.0) return;
    std::normal_distribution<double> normal;
    Track track;
    track.id = obstacle.track;
    track.kind = obstacle.kind;
    track.visible = true;
    track.position_m = truth.inverse() * centroid(obstacle.footprint_m);
    track.contact_m = track.position_m * (1.0 - 0.1 / distance);
    const outline::PrismView view{truth, {0, 0}, kCameraHeightM, {}};
    track.supports = outline::prismSupports(obstacle.footprint_m, obstacle.height_m, view, 1.0);
    for (std::size_t k = 0; k < track.supports.size(); ++k) {
      const double scale = kCameraHeightM / (kCameraHeightM - obstacle.height_m);
      const double at = track.supports.b_m[k] > 0 ? distance * scale : distance;
      const double sigma =
          0.4 * (kCameraHeightM * kCameraHeightM + at * at) / (kCameraHeightM * 305.0) + 0.001;
      track.supports.sigma_m[k] = static_cast<float>(sigma);
      track.supports.b_m[k] += static_cast<float>(options_.support_noise * sigma * normal(random_));
    }
    objects.tracks.push_back(track);
  }

  std::vector<SimObstacle> obstacles_;
  std::vector<SimRobot> robots_;
  SimOptions options_;
  RobotBody body_{0.15, {}, 0.3, 0.26};
  std::mt19937 random_;
};

}  // namespace omnifleet::testing
